"""Both implementations of a window, side by side: all arrays of missions of all kinds are equal."""

from dataclasses import fields

import numpy as np
import pytest
from turns import settled

from swarm_mj.mission import paper, reference
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol import compiled_window, window
from swarm_mj.protocol.buffers import BROADCAST, Buffers, empty_buffers
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.simulation.swarm import Swarm

SIZE = {"num_robots": 9, "num_windows": 30}
MISSIONS = {
    "paper": paper("random-walk", **SIZE),
    "authors": reference("flocking", **SIZE),
    "failures": paper("flocking", failure_fraction=0.4, **SIZE),
    "all known": paper("random-walk", prior_knowledge="start", **SIZE),
    "noise": paper("random-walk", position_noise_m=20.0, position_noise_s=0.2, **SIZE),
    "noise at rest": paper("stationary", position_noise_m=20.0, **SIZE),
    "several decode": paper("random-walk", sinr_threshold_db=-6.0, **SIZE),
}
POLICIES = (
    "random-flooding",
    "round-robin",
    "mst",
    "tdma",
    "csma",
    "age-gain-csma",
    "index-csma",
    "planner",
)


class OtherRadio(FreeSpaceRadio):
    """The same radio by another type, as a user's is: nothing is compiled for it."""


def swarms(mission):
    """Two of the same missions, the second with a radio that nothing is compiled for."""
    compiled = Swarm(mission, [3, 4])
    numbers = {spec.name: getattr(compiled.channel, spec.name) for spec in fields(FreeSpaceRadio)}
    return compiled, Swarm(mission, [3, 4], channel=OtherRadio(**numbers))


def arrays_of(swarm, costs):
    buffers = [getattr(swarm.buffers, spec.name) for spec in fields(Buffers)]
    return [
        *buffers,
        *swarm.phases[0],
        *swarm.phases[1],
        *costs[:3],
        *costs.packets,
        swarm.states.position_m,
    ]


def equal(ours, theirs):
    return [np.array_equal(a, b, equal_nan=True) for a, b in zip(ours, theirs, strict=True)]


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("name", MISSIONS)
def test_policies_fly_the_same_missions(name, policy):
    mission = MISSIONS[name]
    flown = swarms(mission)
    for swarm in flown:
        swarm.start(make_policy(policy, mission))
    for _ in range(mission.num_windows):
        assert all(equal(*(arrays_of(swarm, swarm.step()) for swarm in flown)))


@pytest.mark.parametrize("name", MISSIONS)
def test_random_talk_is_the_same(name):
    """Many packets collide, are answered, overheard, or meant for robots that send."""
    flown, num_decoded, rng = swarms(MISSIONS[name]), 0, np.random.default_rng(0)
    for _ in range(SIZE["num_windows"]):
        recipient = rng.integers(0, 9, (2, 9))
        recipient = np.where(rng.random((2, 9)) < 0.4, recipient, np.arange(9))
        costs = [swarm.step_with_recipients(recipient) for swarm in flown]
        assert all(equal(*map(arrays_of, flown, costs)))
        num_decoded += np.sum(flown[0].phases[1].heard != np.arange(9))
    assert num_decoded > 0


def random_states(rng, num_missions, num_robots, *, fails):
    """Robots anywhere in a square of 300 m, some of which have failed if any may."""
    position_m, velocity_mps = rng.uniform(-150.0, 150.0, (2, num_missions, num_robots, 2))
    is_active = rng.random((num_missions, num_robots)) < 0.8 if fails else None
    return RobotStates(position_m=position_m, velocity_mps=velocity_mps, is_active=is_active)


@pytest.mark.parametrize("half_duplex", ["strict", "eavesdroppers"])
@pytest.mark.parametrize("silence_is_attempt", [False, True])
@pytest.mark.parametrize("fails", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_random_windows_and_broadcasts_leave_the_same_buffers(
    seed, fails, silence_is_attempt, half_duplex
):
    """Any recipients, BROADCAST among them, in turn in windows of requests and in broadcasts."""
    rng, now = np.random.default_rng(seed), np.zeros(3)
    num_robots = int(rng.integers(2, 12))
    radio = radio_of(paper("stationary", num_robots=num_robots, half_duplex=half_duplex))
    ours, theirs = empty_buffers(3, num_robots), empty_buffers(3, num_robots)
    how = {"silence_is_attempt": silence_is_attempt}
    for _ in range(12):
        states = random_states(rng, 3, num_robots, fails=fails)
        recipient = rng.integers(BROADCAST, num_robots, (3, num_robots))
        recipient = np.where(rng.random(recipient.shape) < 0.5, recipient, np.arange(num_robots))
        given = recipient.copy()
        phases = [
            compiled_window.window(ours, *settled(states, recipient), radio, now, **how),
            window.window(theirs, *settled(states, recipient), radio, now, **how),
        ]
        now = now + 1.0
        assert all(equal(*(sum(each, ()) for each in phases)))
        slots = [
            compiled_window.broadcast(ours, states, recipient, radio, now, **how),
            window.broadcast(theirs, states, recipient, radio, now, **how),
        ]
        now = now + 0.5
        assert all(equal(*slots))
        assert all(
            equal(*([vars(known)[name] for name in vars(known)] for known in (ours, theirs)))
        )
        np.testing.assert_array_equal(recipient, given)  # neither writes its arguments


def test_the_radio_compiled_here_is_that_of_the_readable_window():
    """Else both of `swarms` would fly the same implementation."""
    compiled, readable = swarms(MISSIONS["paper"])
    assert compiled.talk.window.func is compiled_window.window
    assert readable.talk.window.func is window.window
