"""The fates of four robots' packets, counted by hand."""

import numpy as np
import pytest

from swarm_mj.protocol.packet_counts import (
    COUNTS,
    count_addressed,
    count_broadcasts,
    no_packets,
)
from swarm_mj.protocol.window import Phase


def slot(recipient, heard):
    return Phase(recipient=np.array([recipient]), heard=np.array([heard]))


def counted(count, first, second):
    """The counts that are defined, by their names."""
    counts = np.zeros(1, COUNTS)
    count(first, second, counts)
    return {name: counts[name][0] for name in COUNTS.names if not np.isnan(counts[name][0])}


def test_alg1_requests_are_delivered_lost_or_overheard_and_responses_answered():
    """0 asks 1, who decodes it, as 3 does; 2 asks 3, who does not. 1 answers: all decode it."""
    request = slot([1, 1, 3, 3], [0, 0, 2, 0])
    response = slot([0, 0, 2, 3], [1, 1, 1, 1])
    assert counted(count_addressed, request, response) == {
        "sent": 2,
        "transmitted": 3,
        "attempted": 2,
        "delivered": 1,
        "lost": 1,
        "overheard": 1 + 2,
        "answered": 1,
    }


def test_a_broadcast_is_heard_once_however_many_decode_it():
    """0 and 3 transmit, and 1 and 2 decode 0; then 1 transmits, and nobody decodes it."""
    everyone = -1
    first = slot([everyone, 1, 2, everyone], [0, 0, 0, 3])
    second = slot([0, everyone, 2, 3], [0, 1, 2, 3])
    assert counted(count_broadcasts, first, second) == {
        "sent": 3,
        "transmitted": 3,
        "heard": 1,
        "receptions": 2,
    }


@pytest.mark.parametrize("num_missions", [1, 3])
def test_a_window_of_silence_is_that_of_alg1_in_which_nobody_transmits(num_missions):
    own = np.tile(np.arange(4), (num_missions, 1))
    counts = np.ones(num_missions, COUNTS)
    silent = Phase(recipient=own, heard=own)
    count_addressed(silent, silent, counts)
    for name in COUNTS.names:
        np.testing.assert_array_equal(no_packets(num_missions)[name], counts[name])
