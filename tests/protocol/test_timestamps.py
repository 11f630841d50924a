"""Timestamps alone, against the buffers of the protocol and by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm_mj.mission import paper
from swarm_mj.protocol.buffers import empty_buffers, merge
from swarm_mj.protocol.timestamps import merge_expected, merge_timestamps, slot_of


def test_a_window_has_two_slots_counted_from_0():
    now = np.array([0.0, 0.5, 7.0, 7.5])
    assert slot_of(now).tolist() == [0, 1, 14, 15]
    assert paper(window_s=0.3).slot_s == 0.15


def random_slot(seed, num_robots):
    """T in whole windows, and whom everyone hears: half of them nobody."""
    rng = np.random.default_rng(seed)
    timestamp = rng.integers(0, 9, (num_robots, num_robots)).astype(float)
    robots = np.arange(num_robots)
    heard = np.where(rng.random(num_robots) < 0.5, rng.integers(0, num_robots, num_robots), robots)
    return timestamp, heard


def after_merge(timestamp, heard):
    """T after the protocol's own merge."""
    buffers = empty_buffers(1, len(heard))
    buffers.timestamp[0] = timestamp
    merge(buffers, heard[None])
    return buffers.timestamp[0]


@given(seed=st.integers(0, 2**32 - 1), num_robots=st.integers(1, 8))
def test_eq8_timestamps_are_those_of_the_buffers(seed, num_robots):
    before, heard = random_slot(seed, num_robots)
    timestamp, expected = before.copy(), after_merge(before, heard)
    merge_timestamps(before, heard, timestamp)
    np.testing.assert_array_equal(timestamp, expected)


@given(seed=st.integers(0, 2**32 - 1), num_robots=st.integers(1, 8))
def test_eq8_the_mean_over_hearing_or_not(seed, num_robots):
    before, heard = random_slot(seed, num_robots)
    probability = np.random.default_rng(seed).integers(0, 5, num_robots) / 4
    merged = np.empty((num_robots, num_robots), dtype=np.float32)
    merge_expected(before.astype(np.float32), heard, probability, merged)
    share = probability[:, None]
    expected = share * after_merge(before, heard) + (1.0 - share) * before
    assert merged == pytest.approx(expected)
