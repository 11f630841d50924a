"""The costs against hand arithmetic, numpy, and loops over packets and parents."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import NO_PARENT, empty_buffers
from swarm_mj.protocol.costs import age_of_information, mean_hops, velocity_variance, window_costs
from swarm_mj.protocol.packet_counts import PACKET_COUNTS, no_packets
from swarm_mj.protocol.window import Phase

seeds = st.integers(0, 2**32 - 1)


def some_active(rng, num_missions, num_robots):
    """Who is on: at least one in each mission, not as many in each."""
    is_active = rng.random((num_missions, num_robots)) < 0.6
    is_active[np.arange(num_missions), rng.integers(0, num_robots, num_missions)] = True
    return is_active


def times(timestamp):
    timestamp = np.array(timestamp, dtype=float)
    return replace(empty_buffers(*timestamp.shape[:2]), timestamp=timestamp)


def some_phase(rng, num_missions, num_robots):
    """Who addressed whom, and whose packet everyone decoded: some sender's, or nobody's."""
    shape = (num_missions, num_robots)
    oneself = np.broadcast_to(np.arange(num_robots), shape)
    recipient = np.where(rng.random(shape) < 0.4, oneself, rng.integers(0, num_robots, shape))
    heard = oneself.copy()
    for b, row in enumerate(recipient):
        senders = [i for i in range(num_robots) if row[i] != i]
        for j in range(num_robots):
            others = [i for i in senders if i != j]
            if others and rng.random() < 0.7:
                heard[b, j] = rng.choice(others)
    return Phase(recipient=recipient, heard=heard)


def broadcasts(phase, b):
    """(sent, heard, receptions) of one phase of mission b, packet by packet."""
    recipient, heard = phase.recipient[b].tolist(), phase.heard[b].tolist()
    sent = [i for i, addressee in enumerate(recipient) if addressee != i]
    hearers = [sum(j != i and sender == i for j, sender in enumerate(heard)) for i in sent]
    return len(sent), sum(number > 0 for number in hearers), sum(hearers)


def fates(phase, b):
    """(sent, arrived, overheard) of one phase of mission b, packet by packet."""
    recipient, heard = phase.recipient[b].tolist(), phase.heard[b].tolist()
    sent = arrived = overheard = 0
    for i, addressee in enumerate(recipient):
        if addressee == i:
            continue
        sent += 1
        for j, sender in enumerate(heard):
            if j != i and sender == i:
                arrived += j == addressee
                overheard += j != addressee
    return sent, arrived, overheard


def some_trees(rng, num_missions, num_robots):
    """Buffers in which every robot knows some teammates over a random tree."""
    buffers = empty_buffers(num_missions, num_robots)
    for b in range(num_missions):
        for i in range(num_robots):
            known = [i]
            buffers.timestamp[b, i, i] = 1.0
            others = [j for j in rng.permutation(num_robots) if j != i]
            for j in others[: rng.integers(0, num_robots)]:
                buffers.parent[b, i, j] = rng.choice(known)
                buffers.timestamp[b, i, j] = 0.5
                known.append(j)
    return buffers


def packets_of(first, second, *, is_broadcast):
    """What a window's costs say of its packets, whatever else happens in it."""
    num_missions, num_robots = first.heard.shape
    buffers, nothing = (
        empty_buffers(num_missions, num_robots),
        np.zeros((num_missions, num_robots, 2)),
    )
    states = RobotStates(position_m=nothing, velocity_mps=nothing)
    now = np.ones(num_missions)
    costs = window_costs(buffers, states, (first, second), now, is_broadcast=is_broadcast)
    return costs.packets


def test_without_transmissions_all_counts_of_requests_are_0():
    silence = np.tile(np.arange(3), (2, 1))
    nobody = Phase(recipient=silence, heard=silence)
    counted = packets_of(nobody, nobody, is_broadcast=False)
    np.testing.assert_array_equal(counted.sent, [0.0, 0.0])
    for name in PACKET_COUNTS:
        np.testing.assert_array_equal(getattr(counted, name), no_packets(2)[name], err_msg=name)


def depth(parent, i, j):
    """Steps from j up to i."""
    return 0 if j == i else 1 + depth(parent, i, parent[j])


@given(seed=seeds, num_missions=st.integers(1, 4), num_robots=st.integers(1, 9))
def test_eq10_eq17_of_those_that_are_on_by_plain_loops(seed, num_missions, num_robots):
    rng = np.random.default_rng(seed)
    timestamp = rng.integers(0, 40, (num_missions, num_robots, num_robots)) / 2.0
    now = rng.integers(20, 30, num_missions).astype(float)
    velocity = rng.normal(size=(num_missions, num_robots, 2))
    is_active = some_active(rng, num_missions, num_robots)
    age, is_complete = age_of_information(times(timestamp), now, is_active)
    variance = velocity_variance(velocity, is_active)
    for b in range(num_missions):
        on = [i for i in range(num_robots) if is_active[b, i]]
        known = [timestamp[b, i, j] for i in on for j in on]
        assert age[b] == pytest.approx(sum(now[b] - t for t in known) / len(known))
        assert is_complete[b] == all(t > 0 for t in known)
        mean = sum(velocity[b, i] for i in on) / len(on)
        squares = [np.sum((velocity[b, i] - mean) ** 2) for i in on]
        assert variance[b] == pytest.approx(sum(squares) / len(on), abs=1e-12)


@given(seed=seeds, num_missions=st.integers(1, 4), num_robots=st.integers(1, 9))
def test_with_everyone_on_costs_are_the_same_bit_for_bit(seed, num_missions, num_robots):
    rng = np.random.default_rng(seed)
    buffers, now = some_trees(rng, num_missions, num_robots), rng.integers(1, 9, num_missions) / 2.0
    position_m, velocity_mps = rng.normal(size=(2, num_missions, num_robots, 2))
    states = RobotStates(position_m=position_m, velocity_mps=velocity_mps)
    phases = some_phase(rng, num_missions, num_robots), some_phase(rng, num_missions, num_robots)
    everyone = np.ones((num_missions, num_robots), dtype=bool)
    some, all_ = (
        window_costs(buffers, replace(states, is_active=is_active), phases, now, is_broadcast=False)
        for is_active in (everyone, None)
    )
    assert some.age_windows.tolist() == all_.age_windows.tolist()
    assert some.is_complete.tolist() == all_.is_complete.tolist()
    assert some.velocity_variance_m2ps2.tolist() == all_.velocity_variance_m2ps2.tolist()
    assert mean_hops(buffers, everyone).tolist() == mean_hops(buffers).tolist()


ADDRESSED = {"attempted": 2, "delivered": 1, "lost": 1, "overheard": 2, "answered": 1}
BROADCAST = {"heard": 2, "receptions": 4}


@pytest.mark.parametrize(
    ("is_broadcast", "expected"),
    [
        (False, {"sent": 2, **ADDRESSED, **dict.fromkeys(BROADCAST, math.nan)}),
        (True, {"sent": 3, **BROADCAST, **dict.fromkeys(ADDRESSED, math.nan)}),
    ],
)
def test_packets_by_hand(is_broadcast, expected):
    """Robot 0's first is heard by 1, for which it is meant, and 2; 3's for 4 by nobody.

    Then 1's for 0 is heard by 0 and 4.
    """
    first = Phase(recipient=np.array([[1, 1, 2, 4, 4]]), heard=np.array([[0, 0, 0, 3, 4]]))
    second = Phase(recipient=np.array([[0, 0, 2, 3, 4]]), heard=np.array([[1, 1, 2, 3, 1]]))
    packets = packets_of(first, second, is_broadcast=is_broadcast)
    counts = {name: count.item() for name, count in packets._asdict().items()}
    assert counts == pytest.approx({"transmitted": 3, **expected}, nan_ok=True)


@given(seed=seeds, num_missions=st.integers(1, 4), num_robots=st.integers(1, 8))
@settings(max_examples=100)
def test_packets_as_by_loops(seed, num_missions, num_robots):
    rng = np.random.default_rng(seed)
    first, second = (some_phase(rng, num_missions, num_robots) for _ in range(2))
    asked = packets_of(first, second, is_broadcast=False)
    flooded = packets_of(first, second, is_broadcast=True)
    for b in range(num_missions):
        flooded_by_loops = np.add(broadcasts(first, b), broadcasts(second, b)).tolist()
        sent, arrived, overheard = fates(first, b)
        _, arrived2, overheard2 = fates(second, b)
        addressed = asked.attempted[b], asked.delivered[b], asked.answered[b]
        assert addressed == (sent, arrived, arrived2)
        assert asked.overheard[b] == overheard + overheard2
        assert asked.sent[b] == asked.attempted[b] == asked.delivered[b] + asked.lost[b]
        counted = [flooded.sent[b], flooded.heard[b], flooded.receptions[b]]
        assert counted == flooded_by_loops


def test_fig1_robot_0_is_one_and_a_half_hops_from_its_team():
    # Fig. 1: 1 and 3 point at 0, 2 and 4 point at 3; the others know nobody here.
    buffers = empty_buffers(1, 5)
    buffers.timestamp[0, 0] = [4, 2, 2, 4, 3]
    buffers.parent[0, 0] = [-1, 0, 3, 0, 3]
    assert mean_hops(buffers).tolist() == [(1 + 2 + 1 + 2) / 4]


@given(seed=seeds, num_missions=st.integers(1, 3), num_robots=st.integers(1, 8))
@settings(max_examples=100)
def test_hops_as_by_walking_up_the_tree(seed, num_missions, num_robots):
    buffers = some_trees(np.random.default_rng(seed), num_missions, num_robots)
    everyone = np.ones((num_missions, num_robots), dtype=bool)
    for is_active in (None, some_active(np.random.default_rng(seed), num_missions, num_robots)):
        hops, counts = mean_hops(buffers, is_active), everyone if is_active is None else is_active
        for b in range(num_missions):
            depths = [
                depth(buffers.parent[b, i], i, j)  # over anyone
                for i in range(num_robots)
                for j in range(num_robots)
                if buffers.timestamp[b, i, j] > 0 and j != i and counts[b, i] and counts[b, j]
            ]
            assert hops[b] == pytest.approx(sum(depths) / len(depths) if depths else 0.0)


def test_what_was_granted_at_the_start_has_come_over_no_radio():
    """Robot 0 has heard robot 1 itself, and robot 2 over robot 1; robot 3 it was told of."""
    buffers = empty_buffers(1, 4)
    buffers.is_granted[:] = True
    buffers.timestamp[0, 0, :3] = 1.0
    buffers.parent[0, 0, :3] = [NO_PARENT, 0, 1]
    assert mean_hops(buffers).tolist() == [1.5]
    assert age_of_information(buffers, np.array([1.0]))[1].tolist() == [True]
