"""Robots that are switched off half-way: who, from when on, and what the others notice of it."""

import numpy as np
import pytest

from swarm_mj.mission import paper, reference
from swarm_mj.mission.placement import draw_survivors
from swarm_mj.policies.registry import POLICIES, make_policy
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm

NUM_WINDOWS, HALF = 21, 10  # of an odd number of windows the first half is the shorter one
SEEDS = [1, 2, 3]
# Both kinds of windows under both presets; the reference one notes silence and lets senders listen.
KINDS = [(preset, name) for preset in (paper, reference) for name in ("mst", "random-flooding")]


def small(task="random-walk", preset=paper, failure_fraction=0.4, **numbers):
    numbers = {"num_robots": 8, "num_windows": NUM_WINDOWS, "velocity_ratio": 1.0} | numbers
    return preset(task, failure_fraction=failure_fraction, **numbers)


def flight(mission, name, probability=0.4):
    """A swarm, once before its missions and after each window of them."""
    swarm = Swarm(mission, SEEDS)
    yield swarm, None
    for flown in rollout(swarm, make_policy(name, mission, probability)):
        yield swarm, flown


def copies(buffers):
    return {name: array.copy() for name, array in vars(buffers).items()}


@pytest.mark.parametrize(
    ("fraction", "num_robots", "num_off"),
    [
        (0.0, 40, 0),
        (0.2, 40, 8),
        (0.24, 10, 2),
        (0.26, 10, 3),
        (0.001, 40, 1),  # at least one,
        (0.9, 40, 36),
        (0.9, 10, 8),  # but two stay on,
        (0.9, 3, 1),
        (0.9, 2, 0),  # even of two
    ],
)
def test_how_many(fraction, num_robots, num_off):
    mission = paper(failure_fraction=fraction, num_robots=num_robots)
    assert mission.num_failures == num_off
    is_active = draw_survivors(mission, [np.random.default_rng(seed) for seed in range(5)])
    if num_off == 0:
        assert is_active is None
    else:
        assert is_active.shape == (5, num_robots)
        assert np.sum(~is_active, axis=1).tolist() == [num_off] * 5


def test_any_robot_may_be_it_and_the_stream_says_who():
    mission = small()
    rngs = [[np.random.default_rng(seed) for seed in range(200)] for _ in range(2)]
    is_active, again = (draw_survivors(mission, each) for each in rngs)
    np.testing.assert_array_equal(is_active, again)
    share_off = np.mean(~is_active, axis=0)  # of 8 robots 3: 0.375, with a standard error of 0.034
    assert np.all(np.abs(share_off - 0.375) < 0.15)


@pytest.mark.parametrize(("num_windows", "first"), [(500, 250), (21, 10), (2, 1), (1, 0)])
def test_when(num_windows, first):
    assert paper(num_windows=num_windows).failure_window == first


@pytest.mark.parametrize(("preset", "name"), KINDS)
def test_missions_are_the_same_until_half_way(preset, name):
    missions = small(preset=preset), small(preset=preset, failure_fraction=0.0)
    flights = zip(*(flight(mission, name) for mission in missions), strict=True)
    for window_, ((some, its), (all_, theirs)) in enumerate(flights):
        is_same = all(
            np.array_equal(a, b)
            for a, b in zip(vars(some.buffers).values(), vars(all_.buffers).values(), strict=True)
        )
        assert is_same == (window_ <= HALF)
        np.testing.assert_array_equal(some.states.position_m, all_.states.position_m)  # walks go on
        assert all_.states.is_active is None
        assert (some.states.is_active is None) == (window_ <= HALF)
        if its is not None and window_ <= HALF:
            np.testing.assert_array_equal(its.costs.age_windows, theirs.costs.age_windows)


@pytest.mark.parametrize(("preset", "name"), KINDS)
def test_who_is_off_learns_nothing_and_is_heard_by_nobody(preset, name):
    before, num_heard, num_lost = None, 0, 0
    for window_, (swarm, _) in enumerate(flight(small("flocking", preset), name)):
        if window_ > HALF:
            off = ~swarm.states.is_active
            assert np.sum(off, axis=1).tolist() == [3, 3, 3]
            for field, array in copies(swarm.buffers).items():
                if array.ndim > 1:  # by robots
                    np.testing.assert_array_equal(array[off], before[field][off], err_msg=field)
            for b, i in zip(*np.nonzero(swarm.states.is_active), strict=True):
                assert np.all(swarm.buffers.timestamp[b, i, off[b]] <= HALF)
                assert swarm.buffers.timestamp[b, i, i] == window_
            for phase in swarm.phases:
                oneself = np.broadcast_to(np.arange(8), off.shape)
                assert np.all(phase.recipient[off] == oneself[off])
                assert np.all(phase.heard[off] == oneself[off])
                assert not np.any(
                    np.take_along_axis(off, phase.heard, axis=1) & swarm.states.is_active
                )
                num_heard += np.sum(phase.heard != oneself)
                num_lost += np.sum(
                    np.take_along_axis(off, phase.recipient, axis=1) & swarm.states.is_active
                )
        before = copies(swarm.buffers)
    assert num_heard > 20
    assert num_lost > 0  # nobody was told: some go on addressing them


@pytest.mark.parametrize("name", POLICIES)
@pytest.mark.parametrize("preset", [paper, reference])
def test_every_policy_flies_on(name, preset):
    *_, (swarm, flown) = flight(small(preset=preset), name, probability=None)
    assert swarm.now.tolist() == [NUM_WINDOWS] * 3
    assert np.all(np.isfinite(flown.costs.age_windows))


def test_a_restart_switches_everyone_on():
    mission = small()
    *_, (swarm, flown) = flight(mission, "mst")
    was_on = swarm.states.is_active
    swarm.restart([7, 8, 9])
    assert swarm.states.is_active is None
    swarm.restart(SEEDS)
    *_, last = rollout(swarm, make_policy("mst", mission, 0.4))
    np.testing.assert_array_equal(swarm.states.is_active, was_on)
    np.testing.assert_array_equal(last.costs.age_windows, flown.costs.age_windows)
