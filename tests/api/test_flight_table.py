"""The table of one flight, from numbers made up by hand."""

from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from swarm_mj.api.flight_summary import FlightSummary
from swarm_mj.api.flight_table import flight_numbers, flight_rows, flight_title
from swarm_mj.api.run import AGE
from swarm_mj.mission import PRESETS, paper
from swarm_mj.policies.registry import WITHOUT_PAYLOAD, make_policy
from swarm_mj.simulation.rollout import Summary
from swarm_mj.system.terminal import named_values

NAN = np.array([np.nan])
BROADCAST = {"packets_sent": 200.0, "packets_transmitted": 200.0, "packets_heard": 150.0}
BROADCAST |= {"hearers_per_packet": 2.5}
ADDRESSED = {"packets_sent": 200.0, "packets_transmitted": 250.0, "packets_attempted": 200.0}
ADDRESSED |= {"packets_delivered": 50.0, "packets_lost": 150.0, "packets_answered": 40.0}
ADDRESSED |= {"packets_overheard": 600.0}
KNOWN = {"aoi_mean": 12.5, "hops_mean": 3.0, "complete_window": 70.0}
KNOWN |= {"velocity_variance_mean": 0.5, "velocity_variance_first": 4.0}
KNOWN |= {"velocity_variance_last": 0.002}


def summary(**numbers):
    """100 windows; whatever is not given does not apply."""
    names = [name for name in Summary.__dataclass_fields__ if not name.startswith("task_cost")]
    given = {name: np.array([x]) for name, x in (KNOWN | numbers).items()}
    return Summary(**(dict.fromkeys(names, NAN) | given | {"num_windows": 100}))


def shown(
    policy_name,
    task,
    its,
    strayed=0,
    crashed=None,
    energy_j=(None, None),
    heard_share=0.254,
    robot="point",
):
    """The table's rows as a mapping, and all its text."""
    mission = paper(task, num_robots=7, robot=robot)
    policy = make_policy(policy_name, mission)
    numbers = flight_numbers(mission, policy, its)
    ended = {
        "wall_seconds": 1.5,
        "interrupted": False,
        "heard_share": heard_share,
        "strayed": strayed,
    }
    ended["crashed"] = crashed
    ended["energy_mean_j"], ended["energy_worst_j"] = energy_j
    rows = flight_rows(mission, FlightSummary(**numbers, **ended))
    console = Console(width=80, highlight=False)
    with console.capture() as printed:
        console.print(named_values("a title", rows, caption=AGE))
    text = printed.get()
    assert max(map(len, text.splitlines())) <= 80
    cells = [line.split("│")[1:3] for line in text.splitlines() if "│" in line]
    assert len(cells) <= 16
    return {name.strip(): value.strip() for name, value in cells}, text


SILENT = dict.fromkeys(("packets_sent", "packets_transmitted", "packets_heard"), 0.0)
ROWS = [  # policy, task, numbers, and the rows that they make
    (
        *("planner", "flocking", BROADCAST | {"agreed_window": 36.0, "decay_rate": 0.1}),
        {
            "packets broadcast": "200 (2.0 a window)",
            "heard by at least one robot": "150 (75%)",
            "robots that heard a packet, mean": "2.50",
            "age of information, mean": "12.50 windows (1.2 s)",
            "all pairs first informed": "after 70 windows (7 s)",
            "flock agreed: under 1% is left": "from window 36 on (3.6 s)",
            "falls at first by": "10% a window (19% if all knew all)",
        },
    ),
    (
        *("mst", "flocking", ADDRESSED),
        {
            "packets sent, each to one robot": "200 (2.0 a window)",
            "delivered": "50 (25%)",
            "lost": "150 (75%)",
            "answered, and the answer heard": "40 (20%)",
            "overheard by other robots": "600 times",
            # Header 3 and 7 entries of 9 are 66 bytes; 250 of them in 10 s are 13.2 kbit/s.
            "bytes each": "66",
            "sent by the team": "13.2 kbit/s",
        },
    ),
    (
        *("tdma", "flocking", SILENT | {"complete_window": np.nan, "velocity_variance_last": 1.0}),
        {
            "packets broadcast": "0 (0.0 a window)",
            "heard by at least one robot": "0",
            "robots that heard a packet, mean": "-",
            "all pairs first informed": "never; 25% of pairs at the end",
            "flock agreed: under 1% is left": "no, 25.0%",
        },
    ),
    (
        *("tdma", "flocking", BROADCAST | {"complete_window": 1.0, "agreed_window": 100.0}),
        {
            "all pairs first informed": "after 1 window (0.1 s)",
            "flock agreed: under 1% is left": "from window 100 on (10 s)",
        },
    ),
    (*("tdma", "flocking", BROADCAST), {"first to last window": "4.0000 to 0.0020 m²/s²"}),
    (*("tdma", "random-walk", BROADCAST), {"heard by at least one robot": "150 (75%)"}),
    (
        *("planner", "stationary", BROADCAST),
        {"packets carry": "the sender's buffer and links", "decentralised": "yes"},
    ),
    (*(WITHOUT_PAYLOAD, "stationary", BROADCAST), {"packets carry": "the sender's buffer"}),
    (
        *("round-robin", "stationary", BROADCAST),
        {"decentralised": "no: a centre knows all positions"},
    ),
]


def test_robots_that_nobody_reaches_any_more_have_a_row():
    row = "robots out of everyone's range"
    flock = summary(**BROADCAST)
    assert shown("tdma", "flocking", flock, strayed=2)[0][row] == "2 at the end"
    assert row not in shown("tdma", "flocking", flock)[0]


def test_only_points_have_the_law_of_perfect_knowledge_beside_them():
    flock = summary(**BROADCAST | {"decay_rate": 0.1})
    row = "falls at first by"
    assert shown("tdma", "flocking", flock)[0][row] == "10% a window (19% if all knew all)"
    assert shown("tdma", "flocking", flock, robot="quadrotor")[0][row] == "10% a window"


def test_a_walk_has_the_velocity_variance_if_its_controller_counts_it():
    walk = summary(**BROADCAST)
    named = replace(walk, task_cost_name="velocity variance", task_cost_unit="m²/s²")
    row = "velocity variance, mean"
    assert row not in shown("tdma", "random-walk", walk)[0]
    assert row in shown("tdma", "random-walk", named)[0]


def test_what_is_not_all_is_not_shown_as_all():
    most = summary(packets_sent=675.0, packets_transmitted=675.0, packets_heard=672.0)
    most = replace(most, complete_window=NAN)
    rows = shown("tdma", "random-walk", most, heard_share=0.9993)[0]
    assert rows["heard by at least one robot"] == "672 (>99%)"
    assert rows["all pairs first informed"] == "never; >99% of pairs at the end"


def test_only_bodies_crash():
    """Points have no row of it."""
    row = "robots crashed"
    walk = summary(**BROADCAST)
    assert row not in shown("tdma", "random-walk", walk)[0]
    assert shown("tdma", "random-walk", walk, crashed=0)[0][row] == "none"
    assert shown("tdma", "random-walk", walk, crashed=3)[0][row] == "3 of 7; off from then on"
    most = shown("tdma", "random-walk", walk, crashed=6)[0][row]
    assert most == "6 of 7; two radios stay on"


def test_only_bodies_use_energy():
    """Points, and models that do not say what they use, have no row of it."""
    row = "energy per robot; most"
    walk = summary(**BROADCAST)
    assert row not in shown("tdma", "random-walk", walk)[0]
    its = shown("tdma", "random-walk", walk, crashed=0, energy_j=(2821.4, 3104.6))[0]
    assert its[row] == "2,821 J; 3,105 J"


@pytest.mark.parametrize(("policy", "task", "numbers", "rows"), ROWS)
def test_rows_say_what_the_numbers_do(policy, task, numbers, rows):
    table, text = shown(policy, task, summary(**numbers))
    assert {name: table[name] for name in rows} == rows
    assert "how old a robot's news of another is" in text
    is_addressed = "packets_attempted" in numbers
    assert all((word in text) == is_addressed for word in ("delivered", "lost", "overheard"))
    assert ("at least one" in text) != is_addressed
    assert ("agreed" in text) == (task == "flocking")
    assert ("velocity" in text) == (task == "flocking")  # no news changes a walk's


def test_numbers_for_a_file():
    numbers = flight_numbers(paper(), make_policy("planner", paper()), summary(**BROADCAST))
    assert (numbers["packets_sent"], numbers["packets_lost"]) == (200, None)
    assert numbers["velocity_variance_left"] == pytest.approx(0.0005)
    assert (numbers["payload"], numbers["is_centralised"]) == ("snapshots", False)
    still = summary(**ADDRESSED, velocity_variance_first=0.0, velocity_variance_last=0.0)
    numbers = flight_numbers(paper(num_robots=6), make_policy("mst", paper()), still)
    assert numbers["velocity_variance_left"] is None
    assert (numbers["payload"], numbers["is_centralised"]) == ("none", True)
    assert (numbers["packet_bytes"], numbers["bytes_per_second"]) == (57, 57 * 25.0)


def test_a_task_with_a_cost_of_its_own_shows_that_instead_of_velocities():
    costs = {"mean": 200.0, "first": 300.25, "last": 100.5}
    its = {f"task_cost_{name}": np.array([cost]) for name, cost in costs.items()}
    named = {"task_cost_name": "formation error", "task_cost_unit": "m"}
    rows, text = shown("mst", "random-walk", replace(summary(**ADDRESSED), **named, **its))
    assert rows["formation error, mean"] == "200.00 m"
    assert rows["first to last window"] == "300.25 to 100.50 m"
    assert "velocity" not in text


@pytest.mark.parametrize(
    ("mission", "title"),
    [
        (paper("flocking"), "flocking, tdma, 40 robots, seed 3"),
        (
            paper("stationary", failure_fraction=0.5),
            "stationary, tdma, 40 robots, 50% of them off half-way, seed 3",
        ),
        (paper("random-walk", collide=True), "random-walk, tdma, 40 robots that collide, seed 3"),
        (
            paper("random-walk", arena="blocks", fading="rayleigh", prior_knowledge="map"),
            "random-walk, tdma, 40 robots, seed 3, arena blocks, fading rayleigh, "
            "prior knowledge map",
        ),
        (paper("flocking", bit_rate=250e3), "flocking, tdma, 40 robots, seed 3, 250 kbit/s"),
        (PRESETS["urban"](), "random-walk, tdma, 40 robots, seed 3, preset urban"),
        (
            paper("flocking", robot="rover", arena="forest", num_robots=6),
            "flocking, tdma, 6 rovers, seed 3, arena forest",
        ),
        (
            paper("stationary", robot="quadrotor", wind_mps=30.0, collide=True),
            "stationary, tdma, 40 quadrotors that collide, at 20 m, wind 30 m/s, seed 3",
        ),
    ],
)
def test_the_title_names_the_robots_the_arena_and_what_the_channel_adds(mission, title):
    assert flight_title(mission, "tdma", 3) == title
