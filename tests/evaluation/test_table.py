"""Tables of results: whole at 100 columns, the freshest first, one per regime."""

import json
from dataclasses import asdict, fields
from types import SimpleNamespace
from typing import get_args

import pytest

from swarm_mj.evaluation.results import COMPUTATIONS, Result
from swarm_mj.evaluation.table import missions_title, print_results
from swarm_mj.mission import Mission, paper
from swarm_mj.system.fields import meaning_of


def some_result(policy, aoi_mean, **overrides):
    """A result whose other numbers are 1; its task has no cost of its own."""
    values = {
        spec.name: {str: "paper", int: 1, float: 1.0}[(get_args(spec.type) or (spec.type,))[0]]
        for spec in fields(Result)
    }
    values |= {"task_cost_name": None, "config": "{}", "robot": "point"}
    return Result(**values | {"policy": policy, "aoi_mean": aoi_mean} | overrides)


NOTHING = {spec.name: None for spec in fields(Result) if type(None) in get_args(spec.type)}
LARGEST = dict.fromkeys(("aoi_sem", "published_aoi_sem", "velocity_variance_mean"), 12.345)
LARGEST |= dict.fromkeys(("aoi_median", "aoi_p95", "published_aoi_mean"), 115.7268)
LARGEST |= {"aoi_ci_low": 100.001, "aoi_ci_high": 222.222}
LARGEST |= {"packet_bytes": 164_283, "bytes_per_second": 11_111_111.1, "payload": "snapshots"}
LARGEST |= {"heard_ratio": 1.0, "packets_per_window": 79.987, "hearers_per_packet": 39.125}
LARGEST |= {"aoi_difference_mean": -123.456}
LARGEST |= {"aoi_difference_ci_low": -222.222, "aoi_difference_ci_high": -111.111}


@pytest.fixture
def printed(capsys, monkeypatch):
    """What is printed on a console of so many columns."""

    def lines(results, columns, *, is_wide=True):
        monkeypatch.setenv("COLUMNS", str(columns))
        print_results(results, is_wide=is_wide)
        return capsys.readouterr().out.splitlines()

    return lines


@pytest.mark.parametrize("columns", [60, 100])
def test_the_largest_numbers_are_whole_at_100_columns(printed, columns):
    names = ("random-flooding", "greedy-oracle", "planner --payload none")
    moving = {"task": "flocking"} | LARGEST
    results = [some_result(name, 123.456, **moving) for name in names]
    lines = printed(results, columns)
    assert max(map(len, lines)) <= 100
    text = "\n".join(lines)
    assert "…" not in text
    for number in ("123.46 ± 12.35", "100.00, 222.22", "-222.22, -111.11", "115.73 ± 12.35"):
        assert number in text


def test_the_table_has_what_most_people_read_unless_it_is_wide(printed):
    first = {"baseline": "b", **NOTHING, "aoi_sem": 0.5, "delivery_ratio": 0.25, "episodes": 9}
    other = {
        "aoi_difference_mean": 1.5,
        "aoi_difference_ci_low": 1.0,
        "aoi_difference_ci_high": 2.0,
    }
    results = [some_result("a", 3.5, **first | other), some_result("b", 2.0, **first)]
    lines = printed(results, 80, is_wide=False)
    heading, _, *table = lines[[line[:6] for line in lines].index("policy") :]
    tails = ["median,", "p95", "all"]
    compared = ["minus", "b's", "[95", "%]"]
    assert heading.split() == ["policy", "AoI", "±", "SEM", *tails, *compared, "heard"]
    assert table[0].split() == ["b", "2.00", "±", "0.50", "1.0,", "1.0", "100%", "-", "25%"]
    tails = ["1.0,", "1.0", "100%"]
    assert table[1].split() == ["a", "3.50", "±", "0.50", *tails, "1.50", "[1.00,", "2.00]", "25%"]
    assert max(map(len, lines)) <= 80
    for rare in ("Bytes", "Published", "kbit/s"):
        assert rare not in "\n".join(lines)


def test_the_table_of_flocks_fits_into_80_characters_too(printed):
    numbers = {
        "baseline": "tdma",
        "aoi_median": 53.4,
        "aoi_p95": 163.3,
        "aoi_difference_mean": 26.15,
        "aoi_difference_ci_low": 20.83,
        "aoi_difference_ci_high": 31.23,
        "agreed_share": 1.0,
        "agreed_window_median": 100.0,
    }
    result = some_result("spatial-tdma", 52.17, task="flocking", aoi_sem=2.97, **numbers)
    lines = printed([result], 80, is_wide=False)
    (row,) = [line for line in lines if line.startswith("spatial-tdma")]
    assert row.endswith("100%, 100")
    assert max(map(len, lines)) <= 80, row


def test_a_long_name_widens_the_table_and_cuts_no_number(printed):
    name = "runs/" + 60 * "z"
    lines = printed([some_result(name, 123.456, task="flocking", **LARGEST)], 100)
    (row,) = (line for line in lines if line.startswith(name) and "±" in line)
    assert "…" not in row
    assert row.split()[1:4] == ["123.46", "±", "12.35"]
    assert row.split()[-3:] == ["115.73", "±", "12.35"]


def test_the_freshest_comes_first_in_each_regime(printed):
    results = [
        some_result("a", 3.0),
        some_result("b", 1.0),
        some_result("c", 2.0),
        some_result("d", 9.0, task="flocking"),
        some_result("e", 8.0, task="flocking"),
    ]
    lines = printed(results, 100)
    lines = lines[: [line[:4] for line in lines].index("AoI:")]  # without the legend
    order = [line[0] for line in lines if line[:2] in {f"{name} " for name in "abcde"}]
    assert order == ["b", "c", "a", "e", "d"]
    assert sum("preset paper: 1 robots" in line for line in lines) == 2


def test_only_columns_that_are_shown_are_explained(printed):
    resting = " ".join(" ".join(printed([some_result("a", 3.0)], 200, is_wide=False)).split())
    assert "Heard: packets" in resting
    assert "Agreed:" not in resting
    flocks = " ".join(
        " ".join(printed([some_result("a", 3.0, task="flocking")], 200, is_wide=False)).split()
    )
    assert "Heard:" not in flocks
    assert "Agreed: flocks" in flocks


@pytest.mark.parametrize("is_wide", [False, True])
@pytest.mark.parametrize(("episodes", "is_few"), [(5, True), (6, False)])
def test_missions_too_few_for_intervals_are_named(printed, episodes, is_few, is_wide):
    lines = printed([some_result("a", 3.0, episodes=episodes)], 200, is_wide=is_wide)
    assert ("are too narrow" in " ".join(" ".join(lines).split())) == is_few


def test_titles_of_teams_at_rest_say_how_they_move_only_if_that_was_asked_for(printed):
    at_rest = {"task": "stationary", "velocity_ratio": 0.15, "boundary": "reflect"}
    moving = at_rest | {"task": "random-walk"}
    for traits, is_said in (
        (at_rest, False),
        (at_rest | {"boundary": "none"}, True),
        (moving, True),
    ):
        text = "\n".join(printed([some_result("a", 3.0, **traits)], 100))
        assert ("velocity ratio 0.15" in text, f"boundary {traits['boundary']}" in text) == (
            is_said,
            is_said,
        )
        assert "1 windows of paper physics" in text


def test_policies_are_named_under_which_most_missions_ended_before_all_had_heard_of_all(printed):
    shares = {"mst": 0.25, "tdma": 0.5, "gossip": 0.0}
    results = [some_result(name, 3.0, complete_share=share) for name, share in shares.items()]
    said = "missions that ended with everyone having heard of everyone: mst 25%, gossip 0%"
    assert said in printed(results, 100, is_wide=False)
    assert "at last" not in "\n".join(printed(results[1:2], 100))


def rows(lines, policy):
    """The words of both lines of a policy's row."""
    first = next(index for index, line in enumerate(lines) if line.startswith(policy))
    return lines[first].split(), lines[first + 1].split()


def test_what_does_not_exist_is_a_dash(printed):
    nothing = NOTHING | {"task": "flocking"}
    above, below = rows(printed([some_result("mst", 2.0, **nothing)], 100), "mst")
    assert above == ["mst", "2.00", "1.00", "100%", "-", "1.00", "-", "1.0000", "-"]
    # p95; no packet was sent, so no share of them arrived; in older files, nobody knows who agreed.
    assert below == ["1.00", "-", "-", "-"]


def test_broadcasts_have_hearers_and_addressed_packets_arrive(printed):
    broadcast = {"delivery_ratio": None, "heard_ratio": 0.97, "hearers_per_packet": 4.111}
    addressed = {"delivery_ratio": 0.77, "heard_ratio": None, "hearers_per_packet": None}
    results = [some_result("tdma", 1.0, **broadcast), some_result("mst", 2.0, **addressed)]
    lines = printed(results, 100)
    (above, below), (above_mst, below_mst) = rows(lines, "tdma"), rows(lines, "mst")
    assert ("97%" in below, "4.11" in above) == (True, True)
    assert ("77%" in below_mst, "-" in above_mst) == (True, True)


@pytest.mark.parametrize(
    ("option", "payload", "mark"),
    [
        ("", "snapshots", ["+", "snapshots"]),
        (" --payload none", "none", ["--payload", "none"]),
        ("", None, []),
    ],
)
def test_payloads_beyond_the_papers_are_marked_and_explained(printed, option, payload, mark):
    lines = printed([some_result(f"planner{option}", 1.0, payload=payload)], 100)
    above, below = rows(lines, "planner")
    assert (above[:2], below[: len(mark)]) == (["planner", "1.00"], mark)
    text = " ".join(" ".join(lines).split())
    assert ("+: larger packets" in text) == (payload == "snapshots")


def test_what_packets_weigh_and_what_teams_send(printed):
    """1000 bytes a second are 8 kbit/s; files made before it was counted say nothing of it."""
    known = some_result("mst", 1.0, packet_bytes=7263, bytes_per_second=1000.0)
    older = some_result("tdma", 2.0, packet_bytes=None, bytes_per_second=None)
    lines = printed([known, older], 100)
    assert "7,263" in rows(lines, "mst")[1]
    assert "sent by the team [kbit/s]: mst 8.0" in lines


def test_the_lower_bound_stands_below(printed):
    lines = printed([some_result("a", 1.0), some_result("b", 2.0, aoi_floor_mean=1.75)], 100)
    assert "lower bound (connectivity): 1.00 to 1.75, by policy" in lines
    assert "lower bound (connectivity): 1.00" in printed([some_result("a", 1.0)], 100)
    for nothing in (None, 0.0, 0.004):  # none, or one that says nothing
        unknown = "\n".join(printed([some_result("a", 1.0, aoi_floor_mean=nothing)], 100))
        assert "ower bound" not in unknown
    assert "variance" not in unknown  # which depends on the policy in flocks alone


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"failure_fraction": 0.2}, "1 windows of paper physics, 20% of the robots off half-way, "),
        ({"config": '{"collide": true}'}, "1 windows of paper physics, robots collide, 1 mission "),
        ({"bit_rate": 250e3}, ",\nbit rate 250 kbit/s\n"),
        ({"bit_rate": 1e6}, ",\nbit rate 1 Mbit/s\n"),
        ({"arena": "blocks"}, ",\narena blocks\n"),
        (
            {"robot": "quadrotor", "config": '{"height_m": 20.0, "wind_mps": 5.0}'},
            ",\nrobot quadrotor, at 20 m, wind 5 m/s\n",
        ),
        ({"robot": "rover", "config": '{"height_m": 20.0}'}, ",\nrobot rover\n"),
        ({"radio": "fading rayleigh"}, ",\nradio fading rayleigh\n"),
        ({"prior_knowledge": "map,start"}, ",\nprior knowledge map,start\n"),
        ({"channel": "my:Radio"}, ",\nchannel my:Radio\n"),
    ],
)
def test_other_regimes_are_tables_of_their_own_and_say_so(printed, other, said):
    plain = NOTHING | {"arena": "open", "prior_knowledge": "nothing", "failure_fraction": 0.0}
    text = "\n".join(printed([some_result("a", 1.0, **plain | each) for each in ({}, other)], 100))
    assert text.count("preset paper: 1 robots") == 2
    assert text.count(said) == 1


# Fields whose other value, or what it needs to count, does not follow from their declarations.
AMONG_BODIES = {"robot": "quadrotor"}
OTHER = {
    "arena": {"arena": "blocks"},
    "bit_rate": {"bit_rate": 1e5},
    "burst_end": {"burst_begin": 0.02, "burst_end": 0.5},
    "collide": {"physics": "contact", "collide": True},
    "gust_s": AMONG_BODIES | {"gust_mps": 2.0, "gust_s": 9.0},
    "high_power_db": {"high_power_fraction": 0.5, "high_power_db": 3.0},
    "prior_knowledge": {"prior_knowledge": "start"},
    "rician_k": {"fading": "rician", "rician_k": 3.0},
    "robot": AMONG_BODIES,
    "sensing_dbm": {"noise_dbm": -100.0, "sensing_dbm": -90.0},
    "shadowing_distance_m": {"shadowing_db": 6.0, "shadowing_distance_m": 80.0},
    "task": {"task": "flocking"},
}


def other_fields(spec):
    """Fields of a mission of which the last is not as usual, and counts."""
    if spec.name in OTHER:
        return OTHER[spec.name]
    about = meaning_of(spec)
    if about.choices:
        value = next(choice for choice in about.choices if choice != spec.default)
    else:
        middle = 0.3 * about.low + 0.7 * about.high
        value = int(middle) if isinstance(spec.default, int) else middle
    switch = about.counts_with
    if switch is None:
        needed = {}
    elif switch.others:
        needed = AMONG_BODIES
    else:
        needed = {switch.name: switch.state or 2.0}
    return needed | {spec.name: value}


# The columns that the title takes.
OF_MISSIONS = (
    *("task", "preset", "num_robots", "range_ratio", "velocity_ratio", "boundary", "physics"),
    *("num_windows", "failure_fraction", "episodes", "seed", "arena", "radio", "prior_knowledge"),
    *("robot", "bit_rate"),
)


def title_of(mission):
    """The title of a mission's results: as they are made, but for what was measured."""
    study = SimpleNamespace(episodes=3, seed=4)
    own = SimpleNamespace(mission=mission, study=study, component=lambda _kind: None)
    cells = {name: COMPUTATIONS[name](own) for name in OF_MISSIONS}
    none = dict.fromkeys(("channel", "controller", "scene", "pilot"))
    return missions_title(
        some_result("a", 1.0, **none, **cells, config=json.dumps(asdict(mission)))
    )


OPTIONS = [spec for spec in fields(Mission) if meaning_of(spec).help]  # the title names presets


@pytest.mark.parametrize("spec", OPTIONS, ids=lambda spec: spec.name)
def test_missions_that_differ_in_an_option_differ_in_their_title(spec):
    other = other_fields(spec)
    usual = {name: value for name, value in other.items() if name != spec.name}
    titles = [title_of(paper(**{"task": "random-walk"} | given)) for given in (usual, other)]
    assert titles[0] != titles[1]


def test_the_title_says_which_missions(printed):
    own = NOTHING | {"seed": 7}
    two = [some_result("a", 1.0, **own, episodes=number) for number in (1, 12)]
    text = " ".join(" ".join(printed(two, 100)).split())
    assert "half-way, 1 mission from seed 7" in text
    assert "half-way, 12 missions from seed 7" in text


def test_a_tasks_own_cost_has_a_column_and_a_sentence(printed):
    cost = {"name": "formation error", "unit": "m", "mean": 321.5, "sem": 1.25, "last_mean": 12.25}
    cost |= {"difference_mean": -4.5, "difference_ci_low": -7.0, "difference_ci_high": -2.0}
    columns = {f"task_cost_{name}": value for name, value in cost.items()}
    lines = printed([some_result("mst", 1.0, task="random-walk", **columns)], 100)
    text = " ".join(" ".join(lines).split())
    sentence = "Task cost: formation error [m], mean over windows ± standard error"
    for said in ("± 1.25", "-7.00, -2.00", "321.50", "12.25", sentence):
        assert said in text
