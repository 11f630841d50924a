import math

import numpy as np
import pytest
from standing_teams import view_of

from swarm_mj.policies.planner.discovery import Discovery, Purpose
from swarm_mj.policies.planner.settings import PlannerSettings

RANGE_M = 100.0
NUM_ROBOTS = 6
LATE = 60  # slots: 5 rounds of 6 windows


# What the arithmetic here is about, whatever suits the planner best.
SETTINGS = PlannerSettings(
    transmitters_per_reach=0.4,
    max_transmitters=8,
    num_fast_rounds=2,
    later_share=0.5,
    polite_ranges=1.5,
    num_orders=40,
    search_rounds=5.0,
    latest_search_windows=200,
    search_every_windows=5,
)


def discovery_of(num_robots, num_reaches, seed=0):
    return Discovery(
        num_robots, SETTINGS, np.random.default_rng(seed), num_reaches=num_reaches, range_m=RANGE_M
    )


def order_of(seed):
    """The order of the search: the first that is drawn."""
    return np.random.default_rng(seed).permutation(NUM_ROBOTS).tolist()


def at_places(position_m, knows, heard=None):
    """A view at t = 1 in which robot i has heard of itself and of whom it knows."""
    timestamp = np.eye(len(position_m))
    for i, known in knows.items():
        timestamp[i, list(known)] = 1.0
    return view_of(timestamp, position_m * timestamp[..., None], now=1.0, heard=heard)


def strangers(num_robots):
    """Robots in one place, none of which has heard of another."""
    return at_places(np.zeros((num_robots, 2)), {})


def round_of_transmitters(turns, num_robots, first):
    """Who transmits, slot by slot, until as many spoke as there are robots."""
    transmitters, slot = [], first
    while sum(map(len, transmitters)) < num_robots:
        transmits = turns.transmits(slot, strangers(num_robots))
        transmitters.append(np.flatnonzero(transmits).tolist())
        slot += 1
    return transmitters


@pytest.mark.parametrize(
    ("num_robots", "num_reaches", "at_once", "later"),
    [
        (40, 5.1, 2, 1),  # 0.4 of 5.1 is 2.04
        (40, 7.0, 3, 1),  # 2.8; half of 3 is 1 and a half
        (40, 18.0, 7, 3),  # 7.2
        (40, 500.0, 8, 4),  # no more
        (40, 0.1, 1, 1),  # no less
        (3, 500.0, 2, 2),  # never all: somebody must listen
    ],
)
def test_how_many_speak_at_once_by_hand(num_robots, num_reaches, at_once, later):
    turns, slot = discovery_of(num_robots, num_reaches), 0
    for count in (at_once, at_once, later, later):
        transmitters = round_of_transmitters(turns, num_robots, slot)
        assert len(transmitters) == math.ceil(num_robots / count)
        assert {len(group) for group in transmitters[:-1]} == {count}
        assert sorted(i for group in transmitters for i in group) == list(range(num_robots))
        slot += len(transmitters)


def test_orders_differ_from_round_to_round_and_repeat_after_40():
    """One of 6 robots at a time: rounds of 6 slots."""
    turns = discovery_of(NUM_ROBOTS, 1.0)
    flown = [round_of_transmitters(turns, NUM_ROBOTS, 6 * k) for k in range(41)]
    assert flown[40] == flown[0]
    assert len({str(transmitters) for transmitters in flown[:40]}) > 30


@pytest.mark.parametrize(
    ("apart_m", "knows_first", "knows_bystander", "transmits"),
    [(149.0, True, False, False), (151.0, True, False, True), (149.0, False, True, True)],
)
def test_robots_that_know_one_near_them_that_comes_before_are_silent(
    apart_m, knows_first, knows_bystander, transmits
):
    """Within one and a half ranges, 150 m; the one that comes first transmits whatever it knows."""
    turns, rng = discovery_of(NUM_ROBOTS, 5.0), np.random.default_rng(0)
    rng.permutation(NUM_ROBOTS)  # the order of the search
    first, then, bystander, *_ = rng.permutation(NUM_ROBOTS).tolist()
    position_m = np.zeros((NUM_ROBOTS, 2))
    position_m[first] = [0.6 * apart_m, 0.8 * apart_m]
    known = {first: [then], then: [first] * knows_first + [bystander] * knows_bystander}
    speaks = turns.transmits(0, at_places(position_m, known))
    assert (speaks[first], speaks[then]) == (True, transmits)


def fresh(*lost):
    return ~np.isin(np.arange(NUM_ROBOTS), lost)


def test_whose_turn_it_is_by_hand():
    """Before 5 rounds of 6 windows have passed the discovery's, while robots are unknown; then the
    search's, while robots are lost, in both slots of every fifth window; else the plan's."""
    turns = discovery_of(NUM_ROBOTS, 1.0)
    everyone, some = fresh(), fresh(2)
    for slot in range(2 * LATE):
        is_early, is_fifth = slot < LATE, slot % 10 in (0, 1)
        late = Purpose.SEARCH if is_fifth else Purpose.PLAN
        assert turns.purpose(slot, some, some) == (Purpose.DISCOVERY if is_early else late)
        assert turns.purpose(slot, everyone, some) == (Purpose.PLAN if is_early else late)
        assert turns.purpose(slot, everyone, everyone) == Purpose.PLAN


@pytest.mark.parametrize(("num_robots", "windows"), [(2, 10), (40, 200), (100, 200)])
def test_large_teams_do_not_wait_for_5_rounds(num_robots, windows):
    turns, nobody = discovery_of(num_robots, 1.0), np.zeros(num_robots, dtype=bool)
    assert turns.purpose(2 * windows - 1, nobody, nobody) == Purpose.DISCOVERY
    assert turns.purpose(2 * windows, nobody, nobody) == Purpose.SEARCH


def sought(slot, lost, heard=None, places_m=None, knows=None, was_missing=None, seed=0):
    """Who transmits in the search, of robots that lost these and decoded `heard[j]`."""
    decoded = np.arange(NUM_ROBOTS)
    for j, i in (heard or {}).items():
        decoded[j] = i
    position_m = np.zeros((NUM_ROBOTS, 2)) if places_m is None else places_m
    view = at_places(position_m, knows or {}, heard=decoded)
    was_fresh = np.tile(fresh(*(lost if was_missing is None else was_missing)), (NUM_ROBOTS, 1))
    transmits = discovery_of(NUM_ROBOTS, 1.0, seed).seeks(
        slot, view, is_fresh=fresh(*lost), was_fresh=was_fresh
    )
    return np.flatnonzero(transmits).tolist()


@pytest.mark.parametrize("seed", [0, 1])
def test_one_of_all_calls_in_order_then_one_of_the_lost(seed):
    order = order_of(seed)
    lost = [order[1], order[4]]
    for turn in range(6, 14):
        assert sought(10 * turn, lost, seed=seed) == [order[turn % 6]]
        assert sought(10 * turn + 1, lost, seed=seed) == [lost[turn % 2]]


def test_whoever_hears_someone_lost_answers_unless_one_near_comes_before():
    """A caller is missing: whoever heard it answers, but one that knows an earlier one, fresh, to
    be within a range of the caller leaves it to that one."""
    order = order_of(0)
    caller, early, late, far = (order[k] for k in (5, 1, 2, 3))
    places_m = np.zeros((NUM_ROBOTS, 2))
    places_m[early] = [60.0, 80.0 - 1e-6]  # just within 100 m of the caller
    places_m[far] = [60.0, 81.0]
    call = {"lost": [caller], "heard": {early: caller, late: caller}, "places_m": places_m}

    def answers(knows, **rest):
        """But for the missing one, whose turn it is to call again."""
        return [i for i in sought(LATE + 1, **call | rest, knows=knows) if i != caller]

    assert answers({early: [caller], late: [caller]}) == sorted([early, late])
    assert answers({early: [caller], late: [caller, early]}) == [early]
    assert answers({early: range(NUM_ROBOTS), late: [caller]}) == [late]  # to order[0]
    after = {"heard": {far: caller, late: caller}}
    assert answers({far: [caller, early], late: [caller]}, **after) == [late]
    assert answers({far: [caller], late: [caller, far]}, **after) == sorted([far, late])
    assert answers({early: [caller], late: [caller, early]}, lost=[caller, early]) == sorted(
        [early, late]
    )


def test_what_was_missing_counts_as_it_was_before_one_heard_of_it():
    """With the call came a snapshot in which the caller is fresh: it is answered all the same."""
    order = order_of(0)
    caller, listener, other = order[5], order[1], order[3]
    knows = {listener: [caller]}
    heard = {listener: caller}
    assert sought(LATE + 1, [other], heard, knows=knows, was_missing=[caller]) == sorted(
        [listener, other]
    )
    assert sought(LATE + 1, [other], heard, knows=knows, was_missing=[other]) == [other]
