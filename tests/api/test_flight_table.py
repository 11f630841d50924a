"""The table of one flight, from numbers made up by hand."""

from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from swarm_mj.api.flight_table import flight_numbers, flight_rows, flight_title
from swarm_mj.api.run import AGE
from swarm_mj.mission import PRESETS, paper
from swarm_mj.policies.registry import WITHOUT_PAYLOAD, make_policy
from swarm_mj.simulation.rollout import Summary
from swarm_mj.system.terminal import named_values

NAN = np.array([np.nan])
BROADCAST = {
    "packets_sent": 200.0,
    "packets_transmitted": 200.0,
    "packets_heard": 150.0,
    "hearers_per_packet": 2.5,
}
ADDRESSED = {
    "packets_sent": 200.0,
    "packets_transmitted": 250.0,
    "packets_attempted": 200.0,
    "packets_delivered": 50.0,
    "packets_lost": 150.0,
    "packets_answered": 40.0,
    "packets_overheard": 600.0,
}


def summary(**numbers):
    """100 windows; whatever is not given does not apply."""
    known = {
        "aoi_mean": 12.5,
        "velocity_variance_mean": 0.5,
        "velocity_variance_first": 4.0,
        "velocity_variance_last": 0.002,
        "hops_mean": 3.0,
        "complete_window": 70.0,
    } | numbers
    return Summary(
        num_windows=100,
        **{
            name: np.array([known[name]]) if name in known else NAN
            for name in Summary.__dataclass_fields__
            if name != "num_windows" and not name.startswith("task_cost")
        },
    )


def shown(policy_name, task, its):
    """The table's rows as a mapping, and all its text."""
    mission = paper(task, num_robots=6)
    policy = make_policy(policy_name, mission)
    rows = flight_rows(mission, flight_numbers(mission, policy, its), 1.5)
    table = named_values("a title", rows, caption=AGE)
    console = Console(width=80, highlight=False)
    with console.capture() as printed:
        console.print(table)
    text = printed.get()
    assert max(map(len, text.splitlines())) <= 80
    cells = [line.split("│")[1:3] for line in text.splitlines() if "│" in line]
    assert len(cells) <= 15
    return {name.strip(): value.strip() for name, value in cells}, text


def test_broadcasts_are_sent_and_heard():
    rows, text = shown("planner", "flocking", summary(**BROADCAST))
    assert rows["packets broadcast"] == "200 (2.0 a window)"
    assert rows["heard by at least one robot"] == "150 (75%)"
    assert rows["robots that heard a packet, mean"] == "2.50"
    assert not any(word in text for word in ("lost", "delivered", "answered", "overheard"))


def test_addressed_packets_are_delivered_or_lost():
    rows, text = shown("mst", "flocking", summary(**ADDRESSED))
    assert rows["packets sent, each to one robot"] == "200 (2.0 a window)"
    assert rows["delivered"] == "50 (25%)"
    assert rows["lost"] == "150 (75%)"
    assert rows["answered, and the answer heard"] == "40 (20%)"
    assert rows["overheard by other robots"] == "600 times"
    assert "at least one" not in text


def test_bytes_are_those_of_all_packets_on_the_air():
    """Six robots: header 3 and 6 entries of 9 are 57 bytes; 250 of them in 10 s are 11.4 kbit/s."""
    rows, _ = shown("mst", "flocking", summary(**ADDRESSED))
    assert rows["bytes each; sent by the team"] == "57; 11.4 kbit/s"
    numbers = flight_numbers(paper(num_robots=6), make_policy("mst", paper()), summary(**ADDRESSED))
    assert (numbers["packet_bytes"], numbers["bytes_per_second"]) == (57, 57 * 25.0)


def test_nothing_sent_has_no_shares():
    silent = {"packets_sent": 0.0, "packets_transmitted": 0.0, "packets_heard": 0.0}
    rows, _ = shown("tdma", "flocking", summary(**silent, complete_window=np.nan))
    assert rows["packets broadcast"] == "0 (0.0 a window)"
    assert rows["heard by at least one robot"] == "0"
    assert rows["robots that heard a packet, mean"] == "-"
    assert rows["everyone had heard of everyone"] == "never"


@pytest.mark.parametrize(
    ("policy", "carried", "decider"),
    [
        ("planner", "the sender's buffer and links", "each robot by itself"),
        (WITHOUT_PAYLOAD, "the sender's buffer", "each robot by itself"),
        ("round-robin", "the sender's buffer", "a centre that is told where all are"),
    ],
)
def test_what_packets_carry_and_who_decides(policy, carried, decider):
    rows, _ = shown(policy, "stationary", summary(**BROADCAST))
    assert rows["packets carry"] == carried
    assert rows["who decides"] == decider


def test_one_window_is_no_windows():
    rows, _ = shown("tdma", "flocking", summary(**BROADCAST, complete_window=1.0))
    assert rows["everyone had heard of everyone"] == "after 1 window (0.1 s)"


def test_ages_are_told_in_windows_and_seconds_and_explained():
    rows, text = shown("tdma", "flocking", summary(**BROADCAST))
    assert rows["age of information, mean"] == "12.50 windows (1.2 s)"
    assert rows["everyone had heard of everyone"] == "after 70 windows (7 s)"
    assert "how old a robot's news of another is" in text


@pytest.mark.parametrize(
    ("last", "verdict"), [(0.002, "yes, under 0.1%"), (0.02, "yes, 0.5%"), (1.0, "no, 25.0%")]
)
def test_whether_a_flock_agreed(last, verdict):
    rows, _ = shown("tdma", "flocking", summary(**BROADCAST, velocity_variance_last=last))
    assert rows["flock agreed: under 1% is left"] == verdict


def test_velocities_are_those_of_moving_teams_and_agreement_that_of_flocks():
    at_rest, _ = shown("tdma", "stationary", summary(**BROADCAST))
    walking, _ = shown("tdma", "random-walk", summary(**BROADCAST))
    assert not any("veloc" in name for name in at_rest)
    assert walking["first to last window"] == "4.0000 to 0.0020 m²/s²"
    assert not any("agreed" in name for name in walking)


def test_numbers_for_a_file():
    numbers = flight_numbers(paper(), make_policy("planner", paper()), summary(**BROADCAST))
    assert numbers["packets_sent"] == 200
    assert numbers["packets_lost"] is None
    assert numbers["velocity_variance_left"] == pytest.approx(0.0005)
    assert (numbers["payload"], numbers["is_centralised"]) == ("snapshots", False)
    still = summary(**ADDRESSED, velocity_variance_first=0.0, velocity_variance_last=0.0)
    numbers = flight_numbers(paper(), make_policy("mst", paper()), still)
    assert numbers["velocity_variance_left"] is None
    assert (numbers["payload"], numbers["is_centralised"]) == ("none", True)


def test_a_task_with_a_cost_of_its_own_shows_that_instead_of_velocities():
    its = replace(
        summary(**ADDRESSED),
        task_cost_name="formation error",
        task_cost_unit="m",
        task_cost_mean=np.array([200.0]),
        task_cost_first=np.array([300.25]),
        task_cost_last=np.array([100.5]),
    )
    rows, text = shown("mst", "formation", its)
    assert rows["formation error, mean"] == "200.00 m"
    assert rows["first to last window"] == "300.25 to 100.50 m"
    assert "velocity" not in text


def test_the_title_names_the_arena_and_what_the_channel_adds():
    assert flight_title(paper("flocking"), "tdma", 3) == "flocking, tdma, 40 robots, seed 3"
    title = flight_title(paper("stationary", failure_fraction=0.5), "mst", 7)
    assert title == "stationary, mst, 40 robots, 50% of them off half-way, seed 7"
    title = flight_title(paper("random-walk", collide=True), "tdma", 3)
    assert title == "random-walk, tdma, 40 robots that collide, seed 3"
    mission = paper("random-walk", arena="blocks", fading="rayleigh", prior_knowledge="map")
    title = flight_title(mission, "tdma", 3)
    assert title == "random-walk, tdma, 40 robots, seed 3, arena blocks, fading rayleigh, known map"
    title = flight_title(paper("flocking", bit_rate=250e3), "tdma", 3)
    assert title == "flocking, tdma, 40 robots, seed 3, 250 kbit/s"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, ""),
        ({"num_robots": 40, "fading": "rician"}, ""),
        ({"arena": "forest"}, ", arena forest"),
        ({"arena": "open"}, ", arena open"),
        ({"path_loss": "free-space", "shadowing_db": 0.0}, ", fading rician, rician_k 8"),
        ({"path_loss": "free-space", "shadowing_db": 0.0, "fading": "none"}, ", free space"),
    ],
)
def test_the_title_names_a_world_and_what_was_changed_in_it(given, said):
    title = flight_title(PRESETS["urban"](**given), "tdma", 3)
    assert title == f"random-walk, tdma, 40 robots, seed 3, preset urban{said}"
