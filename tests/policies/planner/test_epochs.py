import numpy as np
import pytest
from channels import to_nobody, unreliable
from decentralised_reference import (
    SETTINGS,
    common_orders,
    cut_off,
    planner_flight,
    witnessed,
)

from swarm_mj.mission import paper, reference
from swarm_mj.policies.planner.epochs import epoch_windows
from swarm_mj.policies.planner.policy import Planner
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm

TASKS = ["stationary", "random-walk", "flocking"]


# Plans that look no further than the slot in question: seconds less of large teams.
NEAR_SIGHTED = PlannerSettings(max_lookahead_robots=0)
SEEK_EVERY = SETTINGS.search_every_windows


def length_of(num_robots):
    """Of a regular epoch."""
    return epoch_windows(3, num_robots, SETTINGS)


def windows_before(epoch, num_robots, settings=SETTINGS):
    """When an epoch begins [windows]."""
    return sum(epoch_windows(earlier, num_robots, settings) for earlier in range(epoch))


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("preset", [paper, reference])
def test_eq9_sharing_plans_is_planning_apart(preset, task):
    """Every robot decides as one that holds its own buffer and the packets it decoded, alone."""
    flight = witnessed(preset(task, num_robots=10), 10)
    flight.fly(windows_before(5, 10) + 2)
    assert flight.num_taken > 0


@pytest.mark.slow
@pytest.mark.parametrize("task", TASKS)
def test_eq9_sharing_is_planning_apart_in_a_team_of_40(task):
    flight = witnessed(paper(task, num_robots=40), 40, settings=NEAR_SIGHTED)
    flight.fly(windows_before(4, 40) + 2)
    assert flight.num_taken > 0


@pytest.mark.parametrize("task", ["stationary", "flocking"])
def test_eq9_sharing_is_planning_apart_where_everyone_knows_how_all_start(task):
    mission = paper(task, num_robots=10, prior_knowledge="start")
    flight = witnessed(mission, 10)
    flight.fly(windows_before(4, 10) + 2)
    assert flight.num_taken > 0


def test_a_team_that_knows_how_all_start_plans_from_the_first_slot():
    """One robot transmits first, whom most hear; without the plan four would, in the discovery."""
    flight = planner_flight(paper("stationary", num_robots=10, prior_knowledge="start"), 4)
    transmitted = flight.fly(1)
    assert np.sum(transmitted[0]) >= 1
    ((owner, plan),) = flight.team._plans.items()
    assert np.all(flight.team._current.is_known[owner])
    np.testing.assert_array_equal(transmitted, [plan.transmits(slot) for slot in (0, 1)])


SMALL = paper("stationary", num_robots=6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mission", "seed", "channel"),
    [
        (paper("stationary", num_robots=20, range_ratio=0.2), 3, None),
        (paper("random-walk", num_robots=9, velocity_ratio=1.0), 1, None),
        (SMALL, 4, unreliable(4, senders_listen=False)),
        (SMALL, 2, cut_off(SMALL, 2, range(15, 60))),
        (SMALL, 5, cut_off(SMALL, 4, range(60), is_mute=False)),
        (SMALL, 6, cut_off(SMALL, 4, range(60), is_deaf=False)),
        (SMALL, 1, cut_off(SMALL, [2, 5], range(15, 60))),
        (SMALL, 3, cut_off(SMALL, [2, 5], range(15, 60))),
    ],
    ids=["sparse", "fast", "random packets", "cut off", "deaf", "mute", "two", "two more"],
)
def test_eq9_sharing_is_planning_apart_where_snapshots_differ(mission, seed, channel):
    """Teams are not complete after the discovery, fall apart, or miss what others know; who is
    lost is sought, and found."""
    flight = witnessed(mission, seed, channel=channel)
    flight.fly(90 if mission is SMALL else 60)
    assert flight.num_taken > 0


def test_epochs_by_hand():
    """Of 40 robots: a round of 40 windows, two quarters, then halves; but at least 2 and 10."""
    numbers = PlannerSettings(
        first_epoch_rounds=1.0,
        early_epoch_rounds=0.25,
        epoch_rounds=0.5,
        min_epoch_windows=10,
        min_early_epoch_windows=2,
    )
    for num_robots, starts in ((40, [0, 40, 50, 60, 80]), (12, [0, 12, 15, 18]), (2, [0, 2, 4, 6])):
        assert [windows_before(n, num_robots, numbers) for n in range(len(starts))] == starts
    assert [epoch_windows(3, n, numbers) for n in (2, 20, 21, 40, 81)] == [10, 10, 10, 20, 40]


def held_by_all(flight):
    """The owner of the one snapshot that all robots fly by, if they hold the same."""
    held = np.unique(flight.team._current.held).tolist()
    return held[0] if len(held) == 1 else None


def assert_flies_as_planned(flight, num_epochs):
    """From an epoch's beginning on all do as one plan says, and it comes true."""
    length = length_of(flight.mission.num_robots)
    for _ in range(num_epochs):
        transmitted = flight.fly(length)
        owner = held_by_all(flight)
        held = flight.team._plans[owner]
        assert np.all(flight.team._current.is_known[owner])
        np.testing.assert_array_equal(transmitted, [held.transmits(h) for h in range(2 * length)])
        np.testing.assert_array_equal(flight.swarm.buffers.timestamp[0], held.outcome())


@pytest.mark.parametrize("seed", range(3))
def test_a_connected_team_at_rest_flies_one_plan_to_the_letter(seed):
    """Once all 10 robots hold one snapshot, positions are true and no packet that was counted on is
    lost: T is what the plan expects, as soon as all that is older is replaced."""
    flight = planner_flight(paper("stationary", num_robots=10), seed)
    flight.fly(windows_before(5, 10))
    assert_flies_as_planned(flight, 3)


@pytest.mark.parametrize("robot", [0, 5])
def test_a_robot_unheard_in_the_discovery_is_found_later(robot):
    """Nobody knew it when the first plans were made; in the end all fly by one plan with it."""
    mission = paper("stationary", num_robots=8)
    flight = planner_flight(mission, 3, channel=cut_off(mission, robot, range(35)))
    others = np.delete(np.arange(8), robot)
    flight.fly(35)
    assert not np.any(flight.swarm.buffers.is_known[0, others, robot])
    assert not np.any(np.all(flight.team._current.is_known[list(flight.team._plans)], axis=1))
    flight.fly(windows_before(13, 8) - 35)
    assert np.all(flight.swarm.buffers.is_known)
    assert_flies_as_planned(flight, 2)


def test_a_robot_lost_late_is_sought_and_found_again():
    """Robot 2 takes no part for 60 windows: in the end all are fresh to all, and fly one plan."""
    flight = planner_flight(SMALL, 2, channel=cut_off(SMALL, 2, range(40, 100)))
    order, _ = common_orders(2, SMALL)
    flight.fly(95)
    assert held_by_all(flight) is None  # the lost one knows better
    assert not np.all(flight.team._current.is_fresh[list(flight.team._plans), 2])
    turn = 95 // SEEK_EVERY
    for window in range(95, 100):
        calls, _ = flight.fly(1)
        if window % SEEK_EVERY == 0:
            assert np.flatnonzero(calls).tolist() == [order[turn % 6]]
    flight.fly(80)
    assert np.all(flight.team._current.is_fresh[held_by_all(flight)])


@pytest.mark.parametrize("num_robots", [2, 5])
def test_robots_that_never_met_do_not_fall_silent(num_robots):
    """Round after round everyone calls in its turn; later one calls in order, now and then."""
    flight = witnessed(paper("stationary", num_robots=num_robots), 7, channel=to_nobody)
    early = flight.fly(int(SETTINGS.search_rounds * num_robots))
    assert np.all(np.any(early, axis=1))
    calls = flight.fly(2 * num_robots * SEEK_EVERY)
    assert np.sum(calls, axis=0).tolist() == [2] * num_robots
    assert not np.any(calls[np.arange(len(calls)) % (2 * SEEK_EVERY) > 0])


def test_eq10_robots_switched_off_do_not_break_it():
    """Half-way 8 of 40 fall silent, and nobody is told: the others stay younger than by TDMA."""
    mission = paper("stationary", num_robots=40, num_windows=240, failure_fraction=0.2)
    age = {}
    policies = {"planner": Planner(mission, NEAR_SIGHTED), "tdma": make_policy("tdma", mission)}
    for name, policy in policies.items():
        flights = rollout(Swarm(mission, [0, 1]), policy)
        age[name] = np.array([flown.costs.age_windows for flown in flights])
    assert np.all(np.isfinite(age["planner"]))
    assert np.all(np.mean(age["planner"][120:], axis=0) < np.mean(age["tdma"][120:], axis=0))


def test_a_team_that_begins_late_counts_its_epochs_from_there():
    """Another policy flew first: the planner discovers and plans as if the mission began now."""
    mission = paper("stationary", num_robots=5)
    swarm = Swarm(mission, [1])
    tdma, planner = make_policy("tdma", mission), make_policy("planner", mission)
    for _ in range(60):
        swarm.step(tdma)
    ages = [float(swarm.step(planner).age_windows[0]) for _ in range(60)]
    assert max(ages[-10:]) < 6.0
