"""Turns against TDMA itself."""

import numpy as np
import pytest

from swarm_mj.policies.residual.proposals import Proposal, turns
from swarm_mj.policies.tdma import Tdma
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.local_views import LocalViews


def tdma(num_robots, num_slots):
    """The orders of two missions, and who transmits in each slot [slot, mission, robot]."""
    policy = Tdma()
    policy.start(num_robots, [np.random.default_rng(seed) for seed in (3, 4)])
    order = [np.random.default_rng(seed).permutation(num_robots) for seed in (3, 4)]
    buffers = empty_buffers(2, num_robots)
    times = [np.array([slot / 2, (slot + 1) / 2]) for slot in range(num_slots)]
    views = [LocalViews(buffers=buffers, now=now, phases=()) for now in times]
    return np.array(order), np.array([policy.transmits(view) for view in views])


@pytest.mark.parametrize("num_robots", [2, 5, 6])
def test_turns_are_those_of_tdma_and_the_next_ones_are_counted(num_robots):
    """The second mission is one slot ahead. Every robot says the same of everyone."""
    order, flown = tdma(num_robots, 4 * num_robots)
    for slot in range(2 * num_robots):
        is_due, due_in = turns(order, np.array([slot, slot + 1]))
        for b in range(2):
            for j in range(num_robots):
                later = flown[slot + 1 :, b, j].tolist()
                assert is_due[b, :, j].tolist() == [flown[slot, b, j]] * num_robots
                assert due_in[b, :, j].tolist() == [1 + later.index(True)] * num_robots


def test_what_turns_say_can_be_written_robot_by_robot():
    is_due, due_in = turns(np.array([[1, 0, 2]]), np.array([0]))
    is_due[0, 0], due_in[0, 0] = True, 7
    assert is_due[0].tolist() == [[True] * 3, [False, True, False], [False, True, False]]
    assert due_in[0].tolist() == [[7, 7, 7], [1, 3, 2], [1, 3, 2]]


def test_a_robot_should_transmit_if_it_says_so_of_itself():
    is_due = np.array([[[True, False, True], [True, False, True], [False, True, False]]])
    said = Proposal(is_due, np.ones((1, 3, 3), dtype=np.int16), np.zeros((1, 3), dtype=bool))
    assert said.transmits.tolist() == [[True, False, False]]
