"""Both implementations of a window, side by side: all arrays of missions of all kinds are equal."""

from dataclasses import fields

import numpy as np
import pytest

from swarm_mj.mission import paper, reference
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol import window
from swarm_mj.protocol.buffers import Buffers
from swarm_mj.radio.free_space import FreeSpaceRadio
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
POLICIES = ("random-flooding", "round-robin", "mst", "tdma", "csma", "age-gain-csma", "planner")


class OtherRadio(FreeSpaceRadio):
    """The same radio by another type, as a user's is: nothing is compiled for it."""


def swarms(mission):
    """Two of the same missions, the second with a radio that nothing is compiled for."""
    compiled, readable = Swarm(mission, [3, 4]), Swarm(mission, [3, 4])
    numbers = {spec.name: getattr(compiled.channel, spec.name) for spec in fields(FreeSpaceRadio)}
    readable.channel = OtherRadio(**numbers)
    return compiled, readable


def arrays_of(swarm, costs):
    buffers = [getattr(swarm.buffers, spec.name) for spec in fields(Buffers)]
    return [*buffers, *swarm.phases[0], *swarm.phases[1], *costs[:4], swarm.states.position_m]


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


def test_only_the_papers_radio_is_compiled_and_only_for_whole_packets(monkeypatch):
    """Over another channel, and where a slot is too short, the readable window is played."""
    played = []
    noted = window.record_attempt
    note = lambda *given, **how: played.append(1) or noted(*given, **how)  # noqa: E731
    monkeypatch.setattr(window, "record_attempt", note)
    compiled, readable = swarms(MISSIONS["paper"])
    compiled.step(make_policy("tdma", compiled.mission))
    assert len(played) == 0
    readable.step(make_policy("tdma", readable.mission))
    assert len(played) == 2  # broadcasts
    short = Swarm(paper("random-walk", bit_rate=6000.0, **SIZE), [3])
    short.step(make_policy("round-robin", short.mission))
    assert len(played) == 3  # a request and its response
