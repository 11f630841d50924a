"""The entries that go into packets without room for all, by hand, and what a team hears so."""

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.buffers import ABSENT, NEVER, NO_PARENT, empty_buffers, merge
from swarm_mj.protocol.costs import mean_hops
from swarm_mj.protocol.packets import packet_of
from swarm_mj.protocol.partial_buffers import entries_sent, with_room
from swarm_mj.simulation.swarm import Swarm

ALL = [-1, -1, -1, -1, -1]  # everyone broadcasts


def five_robots(num_entries):
    """Robot 0 has heard of everyone; robot 2's news came by robot 1, that of 3 by 2."""
    buffers = empty_buffers(1, 5)
    buffers.timestamp[0, 0] = [9.0, 8.0, 7.0, 6.0, 5.0]
    buffers.parent[0, 0] = [NO_PARENT, 0, 1, 2, 0]
    return with_room(buffers, num_entries)


def sent_by_0(buffers, recipient=ALL):
    """Whose entries are in robot 0's packet, with the T that it holds."""
    sent = entries_sent(buffers, np.array([recipient]))[0, 0]
    is_sent = np.isfinite(sent)
    np.testing.assert_array_equal(sent[is_sent], buffers.timestamp[0, 0, is_sent])
    return np.flatnonzero(is_sent).tolist()


def test_entries_that_rose_most_since_they_were_told_go_first_and_ones_own_always():
    buffers = five_robots(num_entries=3)
    assert sent_by_0(buffers) == [0, 1, 2]
    buffers.timestamp[0, 0] = [10.0, 8.5, 7.5, 6.0, 5.0]  # rises: own, 0.5, 0.5, 6, 5
    assert sent_by_0(buffers) == [0, 3, 4]
    assert sent_by_0(buffers) == [0, 1, 2]
    assert sent_by_0(buffers) == [0, 1, 2]  # all is told: the freshest again


def test_neither_the_unknown_nor_the_silent_have_entries():
    buffers = five_robots(num_entries=4)
    buffers.timestamp[0, 0, 1:] = [NEVER, 7.0, NEVER, NEVER]
    assert sent_by_0(buffers, [0, -1, -1, -1, -1]) == []
    assert np.all(buffers.last_sent[0, 0] == NEVER)
    assert sent_by_0(buffers) == [0, 2]


def test_a_receiver_learns_what_is_in_the_packet_and_its_parents_form_a_tree():
    """Robot 3's parent, 2, is in the packet of four entries; robot 2's, 1, is left out."""
    buffers = five_robots(num_entries=4)
    buffers.last_sent[0, 0, 1] = 8.0  # all of it
    heard = np.array([[0, 1, 2, 3, 0]])
    merge(buffers, heard, entries_sent(buffers, np.array([ALL])))
    assert buffers.timestamp[0, 4].tolist() == [9.0, NEVER, 7.0, 6.0, 5.0]
    assert buffers.parent[0, 4].tolist() == [4, NO_PARENT, 0, 2, 0]


def test_packets_with_room_for_all_are_whole():
    buffers = empty_buffers(1, 5)
    assert entries_sent(with_room(buffers, 5), np.array([ALL])) is buffers.timestamp


@pytest.mark.parametrize("policy_name", ["tdma", "mst"])
def test_a_team_hears_of_everyone_by_partial_packets_later(policy_name):
    """At 160 bit/s times the bytes; a slot short of one byte sends an entry less."""
    whole = packet_of(paper("stationary", num_robots=12)).num_bytes
    ages = []
    for room in (whole, whole - 1, whole - 54, 40):
        mission = paper("stationary", num_robots=12, num_windows=300, bit_rate=room * 160.0)
        swarm, policy = Swarm(mission, [1, 2]), make_policy(policy_name, mission)
        entries = policy.packet(mission).num_entries
        assert entries == {whole: 12, whole - 1: 11, whole - 54: 6, 40: 4}[room]
        costs = [swarm.step(policy) for _ in range(300)]
        assert np.all(costs[-1].is_complete)
        mean_hops(swarm.buffers)  # which complains of parents that lead in a circle
        ages.append(np.mean([each.age_windows for each in costs]))
    assert ages[0] <= ages[1] + 0.5
    assert ages[0] < ages[2] < ages[3]


def test_a_policy_flown_after_one_with_a_payload_has_its_own_room():
    mission = paper("stationary", num_robots=12, bit_rate=160.0 * 200)
    swarm = Swarm(mission, [1])
    swarm.buffers = with_room(swarm.buffers, 3)  # as a policy with a payload leaves them
    swarm.step(make_policy("tdma", mission))
    assert swarm.buffers.num_entries == 12


@pytest.mark.parametrize("fresh", [1, 2])
def test_of_entries_that_rose_alike_the_freshest_is_sent(fresh):
    """Robot 0 has room for one entry beside its own; both others rose by 1 since it sent them."""
    buffers = with_room(empty_buffers(1, 3), 2)
    stale = 3 - fresh
    buffers.timestamp[0, 0] = 6.0
    buffers.timestamp[0, 0, [fresh, stale]] = [5.0, 3.0]
    buffers.last_sent[0, 0, [fresh, stale]] = [4.0, 2.0]
    sent = entries_sent(buffers, np.array([[1, 1, 2]]))
    assert sent[0, 0, [0, fresh, stale]].tolist() == [6.0, 5.0, ABSENT]
