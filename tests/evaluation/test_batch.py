"""A batch's costs against flights summed up apart; no policy is below the floor."""

from dataclasses import replace

import numpy as np
import pytest

from swarm_mj.evaluation.ages import connectivity_floor
from swarm_mj.evaluation.batch import (
    Batch,
    costs_of,
    fly_batch,
)
from swarm_mj.mission import paper
from swarm_mj.mission.placement import largest_part
from swarm_mj.policies.policy_arguments import PolicyArguments
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm

SEEDS = (5, 6, 7)
TOTALS = ("sent", "transmitted", "delivered", "heard", "receptions")


def small(task="random-walk", **overrides):
    return paper(task, **({"num_robots": 6, "num_windows": 31} | overrides))


def batch(mission, policy="mst", seeds=SEEDS, probability=0.3):
    arguments = PolicyArguments(probability=probability)
    return Batch(policy=policy, arguments=arguments, mission=mission, seeds=seeds)


def active(swarm):
    shape = swarm.states.position_m.shape[:2]
    return np.ones(shape, dtype=bool) if swarm.states.is_active is None else swarm.states.is_active


def floor_of(swarm, known):
    """The floor after the window that a swarm has just flown."""
    position_m, range_m = swarm.states.position_m, swarm.mission.range_m
    return connectivity_floor(known, position_m, range_m, swarm.now, active(swarm))


def strayed_by_hand(swarm):
    """The robots that are on, and more than the range away from all others that are on."""
    found = []
    for position_m, is_on in zip(swarm.states.position_m, active(swarm), strict=True):
        apart_m = np.linalg.norm(position_m[:, None] - position_m, axis=2)
        is_near = (apart_m <= swarm.mission.range_m) & is_on & ~np.eye(len(is_on), dtype=bool)
        found.append(np.sum(is_on & ~is_near.any(axis=1)))
    return found


@pytest.mark.parametrize("failure_fraction", [0.0, 0.5])
@pytest.mark.parametrize("policy", ["mst", "random-flooding"])
def test_costs_are_those_of_the_flight(policy, failure_fraction):
    mission = small("flocking", failure_fraction=failure_fraction)
    costs = fly_batch(batch(mission, policy))
    swarm = Swarm(mission, SEEDS)
    flown, ages, floors, known = [], [], [], np.zeros((3, 6, 6))
    for window in rollout(swarm, make_policy(policy, mission, 0.3)):
        flown.append(window)
        age = swarm.now[:, None, None] - swarm.buffers.timestamp
        is_on = active(swarm)
        floors.append(floor_of(swarm, known))
        ages.extend(age[is_on[:, :, None] & is_on[:, None, :] & ~np.eye(6, dtype=bool)].tolist())
    summary = summarise(flown)
    for name in ("aoi", "velocity_variance", "hops"):
        np.testing.assert_allclose(getattr(costs, name), getattr(summary, f"{name}_mean"))
    receptions = summary.hearers_per_packet * summary.packets_sent
    for name in TOTALS:
        expected = getattr(summary, f"packets_{name}", receptions)
        np.testing.assert_allclose(getattr(costs, f"packets_{name}"), expected)
    np.testing.assert_array_equal(costs.complete_window, summary.complete_window)
    np.testing.assert_array_equal(costs.agreed_window, summary.agreed_window)
    np.testing.assert_array_equal(costs.decay_rate, summary.decay_rate)
    assert costs.strayed.tolist() == strayed_by_hand(swarm)
    steady = [window.costs.age_windows for window in flown[15:]]  # the later 16 of 31
    np.testing.assert_allclose(costs.aoi_steady, np.mean(steady, axis=0))
    np.testing.assert_allclose(costs.aoi_floor, np.mean(floors, axis=0))
    assert costs.ages.tolist() == [ages.count(half / 2.0) for half in range(2 * 31 + 1)]


def test_the_floor_is_the_age_that_falling_apart_leaves():
    """Connected teams at rest have none; from when a team first falls apart it has."""
    assert not np.any(fly_batch(batch(small("stationary"))).aoi_floor)
    fast = small(velocity_ratio=2.0)
    swarm, fell_apart = Swarm(fast, SEEDS), np.zeros(3, dtype=bool)
    for _ in rollout(swarm, make_policy("mst", fast)):
        fell_apart |= [not largest_part(p, fast.range_m).all() for p in swarm.states.position_m]
    np.testing.assert_array_equal(fly_batch(batch(fast)).aoi_floor > 0.0, fell_apart)
    assert fell_apart.any()


@pytest.mark.parametrize(
    ("policy", "task"),
    [("mst", "flocking"), ("random-flooding", "random-walk"), ("planner", "random-walk")],
)
def test_a_mission_does_not_depend_on_those_beside_it(policy, task):
    mission = small(task)
    together = fly_batch(batch(mission, policy, probability=None))
    apart = [fly_batch(batch(mission, policy, (s,), probability=None)) for s in SEEDS]
    for name, costs in vars(together).items():
        each = np.array([getattr(alone, name) for alone in apart])
        np.testing.assert_array_equal(costs, each.sum(axis=0) if name == "ages" else each.ravel())
    swapped = fly_batch(batch(mission, policy, SEEDS[::-1], probability=None))
    np.testing.assert_array_equal(swapped.aoi, together.aoi[::-1])


def test_over_a_custom_channel_there_is_no_floor():
    """It assumes the paper's range, which another radio need not have."""
    mission = small("stationary")
    radio = radio_of(mission)
    for channel, expected in (
        (radio, 0.0),
        (replace(radio, power_mw=2.0 * radio.power_mw), np.nan),
        (lambda *given: radio(*given), np.nan),
    ):
        swarm = Swarm(mission, [1], channel=channel)
        costs = costs_of(swarm, rollout(swarm, make_policy("mst", mission)))
        np.testing.assert_array_equal(costs.aoi_floor, [expected])


@pytest.mark.parametrize(
    ("name", "task", "failing"),
    [
        *((name, "random-walk", 0.0) for name in ("random-flooding", "planner", "greedy-oracle")),
        *((name, "random-walk", 0.4) for name in ("mst", "tdma", "lookahead-oracle")),
        *(("mst", "stationary", 0.0), ("mst", "flocking", 0.0)),
    ],
)
def test_no_policy_goes_below_the_floor(name, task, failing):
    """Teams so fast and sparse that they fall apart, some with robots that fail."""
    numbers = {"num_robots": 8, "num_windows": 60, "velocity_ratio": 2.0, "boundary": "reflect"}
    mission = paper(task, **numbers, failure_fraction=failing)
    swarm, known = Swarm(mission, [1, 2]), np.full((2, 8, 8), NEVER)
    floors = []
    for flown in rollout(swarm, make_policy(name, mission)):
        floors.append(floor_of(swarm, known))
        assert np.all(flown.costs.age_windows >= floors[-1] - 1e-9)
    assert (np.max(floors) > 0.0) == (task != "stationary")


def test_energy_is_that_of_the_robots_at_the_end():
    """Six quadrotors and rovers; of points nothing is known."""
    mission = small(robot="quadrotor:2,rover:4", num_windows=5)
    swarm = Swarm(mission, SEEDS)
    found = costs_of(swarm, rollout(swarm, make_policy("tdma", mission)))
    by_robot_j = swarm.states.energy_j.tolist()
    for b in range(len(SEEDS)):
        assert found.energy_j[b] == pytest.approx(sum(by_robot_j[b]) / 6.0)
        assert found.most_energy_j[b] == max(by_robot_j[b]) > 0.0
    points = fly_batch(batch(small(num_windows=5)))
    assert np.all(np.isnan(points.energy_j))
    assert np.all(np.isnan(points.most_energy_j))
