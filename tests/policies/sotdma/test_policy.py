import copy

import numpy as np
import pytest
from decentralised_reference import transmitters

from swarm_mj.mission import paper, reference
from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.sotdma.slot_table import LONG_AGO, NO_PLACE, place_of
from swarm_mj.simulation.swarm import Swarm

REST = paper("stationary", num_robots=12, range_ratio=0.2)
FIRST = 36  # the first slot of a frame, of 11 slots


def flown(mission, seeds, num_windows):
    """Who transmits in each slot [slot, mission, robot], and the policy."""
    policy = make_policy("sotdma", mission)
    return transmitters(Swarm(mission, seeds), policy, num_windows), policy


class Apart(BroadcastPolicy):
    """A flight in which some robots are also asked apart, by their own views and packets alone."""

    def __init__(self, mission, robots):
        self.policy = make_policy("sotdma", mission)
        self.minds = {i: make_policy("sotdma", mission) for i in robots}

    def start(self, num_robots, rngs):
        for mind in self.minds.values():
            mind.start(num_robots, copy.deepcopy(rngs))
        self.policy.start(num_robots, rngs)

    def transmits(self, views):
        decided = self.policy.transmits(views)
        for i, mind in self.minds.items():
            np.testing.assert_array_equal(
                decided[:, i], mind.transmits(self.as_seen_by(i, views))[:, i]
            )
        return decided

    @staticmethod
    def as_seen_by(i, views):
        """All that is not robot i's is lost, but T and P of whom it decoded in the last slot."""
        seen = copy.deepcopy(views)
        for array in vars(seen.buffers).values():
            if array.ndim > 1:  # by robots
                array[:, np.arange(views.num_robots) != i] = 0
        for phase, true in zip(seen.phases, views.phases, strict=True):
            phase.heard[...] = phase.recipient[...] = np.arange(views.num_robots)
            phase.heard[:, i] = true.heard[:, i]
            phase.recipient[:, i] = true.recipient[:, i]
        if seen.phases:
            for b, sender in enumerate(seen.phases[-1].heard[:, i]):
                seen.buffers.timestamp[b, sender] = views.buffers.timestamp[b, sender]
                seen.buffers.parent[b, sender] = views.buffers.parent[b, sender]
        return seen


@pytest.mark.parametrize(
    ("preset", "task"),
    [(paper, "stationary"), (paper, "random-walk"), (reference, "stationary")],
)
def test_eq9_robots_decide_by_their_buffers_and_by_t_and_p_in_packets(preset, task):
    mission = preset(task, num_robots=8, range_ratio=0.2)
    swarm, apart = Swarm(mission, [1, 2]), Apart(mission, [0, 5])
    swarm.start(apart)
    for _ in range(80):
        swarm.step(apart)


def test_it_begins_as_spatial_tdma():
    first, _ = flown(REST, [1, 2], FIRST // 2)
    turns = transmitters(Swarm(REST, [1, 2]), make_policy("spatial-tdma", REST), FIRST // 2)
    np.testing.assert_array_equal(first, turns)


def test_everyone_transmits_once_in_every_frame_in_the_slot_it_owns():
    slots, policy = flown(REST, [3], 100)
    frames = policy._teams[0]._frames
    assert frames.first_slot == FIRST
    places = np.array([place_of(slot, frames) for slot in range(FIRST, 200)])
    sent = slots[FIRST:, 0]
    frame = np.cumsum(places == 0)[places != NO_PLACE]
    counts = [np.sum(sent[places != NO_PLACE][frame == n], axis=0) for n in range(1, 13)]
    # Whoever moves to a later slot of the frame in which it chooses transmits twice in it, or not
    # at all if to an earlier one.
    assert np.mean(np.array(counts) == 1) > 0.9
    assert np.all(np.sum(counts, axis=0) >= 10)
    own = np.diagonal(policy._teams[0]._table.slots)
    last = [np.flatnonzero(sent[:, i] & (places != NO_PLACE))[-1] for i in range(12)]
    np.testing.assert_array_equal(places[last], own)


def test_robots_agree_on_slots():
    """Within a frame of the last choice almost everyone knows everyone's slot."""
    _, policy = flown(REST, [3, 4, 5], 150)
    for team in policy._teams:
        slots = team._table.slots
        assert np.mean(slots == np.diagonal(slots)) > 0.9


@pytest.mark.parametrize("task", ["stationary", "flocking"])
def test_eq10_news_is_younger_than_by_turns(task):
    """Of 16 robots, after the start, over 150 windows: the mean of three missions."""
    mission, age = paper(task, num_robots=16), {}
    for name in ("sotdma", "spatial-tdma", "tdma"):
        swarm, policy = Swarm(mission, [0, 1, 2]), make_policy(name, mission)
        swarm.start(policy)
        age[name] = np.mean([swarm.step(policy).age_windows for _ in range(150)][30:])
    assert age["sotdma"] < 0.95 * age["spatial-tdma"] < age["tdma"]


def test_the_same_seed_is_the_same_flight_whatever_flies_beside():
    beside, _ = flown(REST, [5, 6], 60)
    alone, _ = flown(REST, [6], 60)
    np.testing.assert_array_equal(beside[:, 1:], alone)


def test_packets_that_hold_a_part_of_t_tell_nothing_of_who_was_heard():
    mission = paper("stationary", num_robots=12, range_ratio=0.2, bit_rate=10_000.0)
    for each, tells in ((mission, False), (REST, True)):
        _, policy = flown(each, [1], 60)
        assert np.any(policy._teams[0]._table.decoded > LONG_AGO) == tells
