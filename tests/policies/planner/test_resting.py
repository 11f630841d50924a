import numpy as np
import pytest
from channels import to_nobody
from decentralised_reference import PlannedApart, transmitters

from swarm_mj.mission import paper, reference
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.tdma import Tdma
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.simulation.swarm import Swarm

NAME = "planner --payload none"
REST = paper("stationary", num_robots=10)


def only_plan(policy):
    """The plan that all robots of the first mission follow."""
    (flight,) = policy._teams[0]._flights.values()
    return flight.plan


@pytest.mark.parametrize("preset", [paper, reference])
@pytest.mark.parametrize("task", ["stationary", "random-walk", "flocking"])
def test_eq9_sharing_plans_is_planning_apart(preset, task):
    """Every robot decides as one that holds its own buffer alone, and plans from the beginning."""
    apart = PlannedApart(preset(task, num_robots=7), 3)
    apart.fly(25)
    assert len(apart.plans) == (7 if task == "stationary" else 0)


def test_eq9_late_robots_join_the_plan_of_the_others():
    """A robot that nobody heard for 15 windows, and one that heard nobody, make the same plan."""
    mission, num_calls = paper("stationary", num_robots=6), 0
    radio = radio_of(mission)

    def channel(position_m, recipient):
        nonlocal num_calls
        num_calls += 1
        heard = radio(position_m, recipient)
        if num_calls <= 30:
            heard = np.where((heard == 2) | (np.arange(6) == 4), np.arange(6), heard)
        return heard

    apart = PlannedApart(mission, 1, channel=channel)
    apart.fly(15)
    assert not np.all(apart.swarm.buffers.is_known)
    apart.fly(15)
    assert np.all(apart.swarm.buffers.is_known)
    plan = only_plan(apart.policy)
    after = transmitters(apart.swarm, apart, 10)[:, 0]
    np.testing.assert_array_equal(after, [plan.transmits(slot) for slot in range(60, 80)])


@pytest.mark.parametrize("seed", range(3))
def test_a_team_at_rest_flies_one_plan_and_it_comes_true(seed):
    """T is what the plan expects, as soon as all that is older is replaced."""
    swarm, policy = Swarm(REST, [seed]), make_policy(NAME, REST)
    swarm.start(policy)
    flown = transmitters(swarm, policy, 60)
    plan = only_plan(policy)
    np.testing.assert_array_equal(flown[-40:, 0], [plan.transmits(h) for h in range(80, 120)])
    assert len(plan._transmits) == 120
    np.testing.assert_array_equal(swarm.buffers.timestamp[0], plan._timestamp / 2)


def decisions(position_m, velocity_mps, num_slots=20):
    """Who transmits by policy, slot by slot, in a team that has heard of everyone."""
    buffers = empty_buffers(1, len(position_m))
    buffers.timestamp[:] = 1.0
    buffers.position_m[0], buffers.velocity_mps[0] = position_m, velocity_mps
    policy = make_policy(NAME, REST)
    policy.start(len(position_m), [np.random.default_rng(0)])
    rows = []
    for slot in range(num_slots):
        views = LocalViews(buffers=buffers, now=np.array([slot / 2]), phases=())
        rows.append(policy.transmits(views)[0])
    return np.array(rows)


@pytest.mark.parametrize("changed", ["position", "velocity"])
def test_eq9_whoever_believes_otherwise_plans_otherwise_and_nobody_else(changed):
    """Robot 3 believes in other places, or that one robot moves: the other rows stay the same."""
    rng = np.random.default_rng(5)
    position_m = np.tile(rng.uniform(-300.0, 300.0, (10, 2)), (10, 1, 1))
    velocity_mps = np.zeros_like(position_m)
    before = decisions(position_m, velocity_mps)
    if changed == "position":
        position_m[3] = rng.uniform(-300.0, 300.0, (10, 2))
    else:
        velocity_mps[3, 7] = 0.1
    after = decisions(position_m, velocity_mps)
    others = np.arange(10) != 3
    np.testing.assert_array_equal(after[:, others], before[:, others])
    assert np.any(after[:, 3] != before[:, 3])


@pytest.mark.parametrize("task", ["random-walk", "flocking"])
def test_moving_teams_take_turns_as_in_spatial_tdma(task):
    mission = paper(task, num_robots=12, range_ratio=0.2)
    flown = []
    for name in (NAME, "spatial-tdma"):
        swarm, policy = Swarm(mission, [4, 5]), make_policy(name, mission)
        swarm.start(policy)
        flown.append(transmitters(swarm, policy, 30))
    np.testing.assert_array_equal(*flown)


def test_who_has_not_heard_of_everyone_speaks_in_its_turn_only():
    swarm, policy, tdma = Swarm(REST, [7], channel=to_nobody), make_policy(NAME, REST), Tdma()
    swarm.start(policy)
    flown = transmitters(swarm, policy, 30)
    assert np.all(np.sum(flown, axis=2) == 1)
    assert not policy._teams[0]._flights
    swarm = Swarm(REST, [7], channel=to_nobody)
    swarm.start(tdma)
    np.testing.assert_array_equal(transmitters(swarm, tdma, 30), flown)


def test_eq10_a_plan_from_buffers_is_younger_than_turns():
    """Of 12 robots at rest, over 80 windows: each of two missions."""
    mission, age = paper("stationary", num_robots=12, range_ratio=0.2), {}
    for name in (NAME, "spatial-tdma", "tdma"):
        swarm, policy = Swarm(mission, [0, 1]), make_policy(name, mission)
        swarm.start(policy)
        age[name] = np.mean([swarm.step(policy).age_windows for _ in range(80)], axis=0)
    assert np.all(age[NAME] < 0.8 * np.minimum(age["spatial-tdma"], age["tdma"]))


def test_a_new_start_forgets_and_the_clock_counts_from_there():
    """After 30 windows of another policy, all know all: the plan is flown from its first slot."""
    swarm, policy = Swarm(REST, [1]), make_policy(NAME, REST)
    tdma = make_policy("tdma", REST)
    swarm.start(tdma)
    transmitters(swarm, tdma, 30)
    flown = transmitters(swarm, policy, 10)
    plan = only_plan(policy)
    np.testing.assert_array_equal(flown[:, 0], [plan.transmits(slot) for slot in range(20)])
    policy.start(10, [np.random.default_rng(0)])
    assert not policy._teams[0]._flights


def test_a_team_that_should_rest_but_moves_plans_as_teams_that_move():
    """Robots are pushed to and fro; the age is that of snapshots, not that of turns."""

    def push(buffers, states):
        own = np.arange(buffers.shape[1])
        assert states.velocity_mps.shape == buffers.velocity_mps[:, own, own].shape
        return np.where(buffers.velocity_mps[:, own, own] <= 0.0, 1.0, -1.0)

    mission, age = paper("stationary", num_robots=12, range_ratio=0.3), {}
    for name in ("planner", NAME):
        swarm, policy = Swarm(mission, [0, 1], controller=push), make_policy(name, mission)
        swarm.start(policy)
        age[name] = np.mean([swarm.step(policy).age_windows for _ in range(80)])
    assert age["planner"] < 0.9 * age[NAME]
