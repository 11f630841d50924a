"""The buffers against plain loops over receivers i, senders j and subjects k, and hand examples."""

import copy

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import (
    NO_PARENT,
    Buffers,
    empty_buffers,
    grant_start,
    merge,
    observe_self,
    record_attempt,
)

seeds = st.integers(0, 2**32 - 1)
sizes = st.integers(1, 6)
NAMES = ["timestamp", "position_m", "velocity_mps", "parent", "last_attempt"]


def some_buffers(rng, num_missions, num_robots):
    """Arbitrary contents; few different times, so that many are equally old."""
    shape = (num_missions, num_robots, num_robots)
    return Buffers(
        timestamp=rng.integers(0, 5, shape) / 2.0,
        position_m=rng.normal(size=(*shape, 2)),
        velocity_mps=rng.normal(size=(*shape, 2)),
        parent=rng.integers(-1, num_robots, shape).astype(np.int32),
        last_attempt=rng.integers(0, 5, shape) / 2.0,
        is_granted=np.zeros(num_missions, dtype=np.bool_),
    )


def some_heard(rng, num_missions, num_robots):
    """Anybody decodes anybody, so many senders decode a packet themselves; half hear nobody."""
    shape = (num_missions, num_robots)
    deaf = rng.random(shape) < 0.5
    return np.where(deaf, np.arange(num_robots), rng.integers(0, num_robots, shape))


def case(seed, num_missions, num_robots):
    rng = np.random.default_rng(seed)
    buffers = some_buffers(rng, num_missions, num_robots)
    return rng, buffers, some_heard(rng, num_missions, num_robots)


def same(a, b, names=NAMES):
    return all((getattr(a, name) == getattr(b, name)).all() for name in names)


def merged_by_loops(before, heard):
    """Eq. 8 and the parent rule of II-B, one receiver i, its sender j and one subject k a time."""
    after = copy.deepcopy(before)
    for b, row in enumerate(heard.tolist()):
        for i, j in enumerate(row):
            for k in range(len(row)):
                if i != j and before.timestamp[b, i, k] < before.timestamp[b, j, k]:
                    after.timestamp[b, i, k] = before.timestamp[b, j, k]
                    after.position_m[b, i, k] = before.position_m[b, j, k]
                    after.velocity_mps[b, i, k] = before.velocity_mps[b, j, k]
                    after.parent[b, i, k] = before.parent[b, j, k]
                    if j == k:  # straight from its subject
                        after.parent[b, i, k] = i
    return after


@given(seed=seeds, num_missions=st.integers(1, 3), num_robots=sizes)
def test_eq5_robots_observe_themselves_and_only_themselves(seed, num_missions, num_robots):
    rng, buffers, _ = case(seed, num_missions, num_robots)
    before = copy.deepcopy(buffers)
    position_m, velocity_mps = rng.normal(size=(2, num_missions, num_robots, 2))
    now = rng.integers(5, 9, num_missions) / 2.0
    observe_self(buffers, RobotStates(position_m=position_m, velocity_mps=velocity_mps), now)
    for b in range(num_missions):
        for i in range(num_robots):
            before.timestamp[b, i, i] = now[b]
            before.position_m[b, i, i] = position_m[b, i]
            before.velocity_mps[b, i, i] = velocity_mps[b, i]
    assert same(buffers, before)


@given(seed=seeds, num_missions=st.integers(1, 3), num_robots=sizes)
def test_eq7_attempts_are_noted_for_the_recipient_alone(seed, num_missions, num_robots):
    rng, buffers, _ = case(seed, num_missions, num_robots)
    before = copy.deepcopy(buffers)
    recipient = some_heard(rng, num_missions, num_robots)
    now = rng.integers(5, 9, num_missions) / 2.0
    record_attempt(buffers, recipient, now)
    for b in range(num_missions):
        for i, j in enumerate(recipient[b]):
            if j != i:
                before.last_attempt[b, i, j] = now[b]
    assert same(buffers, before)


def test_eq7_silence_is_an_attempt_only_in_the_code():
    recipient, now = np.array([[1, 1, 2]]), np.array([2.5])
    text, code = empty_buffers(1, 3), empty_buffers(1, 3)
    record_attempt(text, recipient, now)
    record_attempt(code, recipient, now, silence_is_attempt=True)
    assert text.last_attempt[0].tolist() == [[0, 2.5, 0], [0, 0, 0], [0, 0, 0]]
    assert code.last_attempt[0].tolist() == [[0, 2.5, 0], [0, 2.5, 0], [0, 0, 2.5]]


@given(seed=seeds, num_missions=st.integers(1, 3), num_robots=sizes)
@settings(max_examples=200)
def test_eq8_merges_as_by_loops(seed, num_missions, num_robots):
    _, buffers, heard = case(seed, num_missions, num_robots)
    expected = merged_by_loops(buffers, heard)
    merge(buffers, heard)
    assert same(buffers, expected)


def test_what_is_granted_of_the_start_is_known_and_as_old_as_the_mission():
    states = RobotStates(
        position_m=np.array([[[1.0, 2.0], [3.0, 4.0]]]),
        velocity_mps=np.array([[[0.5, 0.0], [0.0, 0.25]]]),
    )
    buffers = empty_buffers(1, 2)
    assert not buffers.is_known.any()
    grant_start(buffers, states)
    assert buffers.is_known.all()
    assert buffers.read_only().is_known.all()
    np.testing.assert_array_equal(buffers.timestamp, np.zeros((1, 2, 2)))  # T is the start
    for i in range(2):
        np.testing.assert_array_equal(buffers.position_m[:, i], states.position_m)
        np.testing.assert_array_equal(buffers.velocity_mps[:, i], states.velocity_mps)
    assert (buffers.parent == NO_PARENT).all()
