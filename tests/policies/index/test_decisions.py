"""Decisions of two robots, by hand: one feature at a time."""

import numpy as np
import pytest

from swarm_mj.policies.index.decisions import (
    MOST_SENSED_DB,
    MOST_SHIFT_DB,
    MOST_SILENCE,
    RECENT,
    decide,
    empty_record,
)
from swarm_mj.policies.index.table import empty_gain
from swarm_mj.policies.index.weights import FEATURES, START

PLAIN = START._replace(
    first=np.array([[4.0]]),
    octaves=np.array([[8.0]]),
    drawn=np.array([[0.25]]),
    threshold=np.array([[0.0]]),
    softness=np.array([[0.0]]),
    shift_db=np.array([[1.0, 0.0, -3.0, 0.0, 0.0, 12.0]]),
    in_index=np.zeros((1, 10)),
    in_silence=np.zeros((1, 10)),
    in_sensing_db=np.zeros((1, 10)),
)


def weighted(name, feature, weight):
    """The plain numbers, but for one feature's weight."""
    weights = np.zeros((1, 10))
    weights[0, FEATURES.index(feature)] = weight
    return PLAIN._replace(**{name: weights})


def decisions(
    gains, weights=PLAIN, *, sent=(), ever=(0, 1), draw=0.0, chance=0.5, phase=1, now=8.0
):
    """The minislots, shifts and records of two neighbours whose packets would bring these gains."""
    record = empty_record(1, 2)
    record.has_sent[0, list(ever)] = True
    record.since_sent[:] = 4.5
    gain = empty_gain(1, 2)
    gain.total[0] = gains
    gain.largest[0] = gains
    gain.neighbours[:] = 1.0
    share, shift_db = np.empty((1, 2)), np.empty((1, 2))
    has_sent = np.zeros((1, 2), bool)
    has_sent[0, list(sent)] = True
    decide(
        record=record,
        gain=gain,
        weights=weights,
        timestamp=np.array([[[8.0, 4.0], [4.0, 8.0]]]),  # a mean age of 2 windows
        now=np.array([now]),
        has_sent=has_sent,
        has_decoded=np.array([[True, False]]),
        covered=np.array([[0.5, 0.0]]),
        begin_draw=np.array([[draw, draw]]),
        silence_draw=np.array([[chance, chance]]),
        phase=phase,
        share=share,
        shift_db=shift_db,
    )
    return share[0], shift_db[0], record


def test_an_octave_more_gain_begins_an_octave_earlier_and_draws_add_to_it():
    """Gains of 4 and 8 windows are 2 and 4 for each of two entries: octaves 1 and 2, of 4 to -4."""
    assert decisions([4.0, 8.0])[0] == pytest.approx([3 / 8, 2 / 8])
    assert decisions([4.0, 8.0], draw=0.5)[0] == pytest.approx([4 / 8, 3 / 8])
    assert decisions([1e9, 8.0])[0][0] == 0.0


@pytest.mark.parametrize(
    ("feature", "value"),
    [
        ("neighbours", -2.0),  # an octave of 2
        ("since_sent", np.log2(6.0) - 3.5),  # 5 windows by now
        ("edge", -0.5),
        ("age", np.log2(3.0) - 4.0),
        ("sent", -0.25),
        ("decoded", 2.0 * RECENT - 0.7),
        ("team", np.log2(2 / 40)),
        ("one_neighbour", -1.0),  # all of it
        ("crowd", 1.3),
        ("news", np.log2(7.0 / 5.0)),  # half of 12 windows, of a gain of 4
    ],
)
def test_a_feature_moves_the_index_by_its_weight(feature, value):
    before = decisions([4.0, 4.0])[0][0]
    after = decisions([4.0, 4.0], weighted("in_index", feature, 0.5))[0][0]
    assert before - after == pytest.approx(0.5 * value / 8.0)


def test_a_robot_with_too_little_gain_is_silent_unless_it_never_sent():
    assert decisions([4.0, 1.9])[0].tolist()[1] == np.inf
    assert np.isfinite(decisions([4.0, 1.9], ever=[0])[0][1])


def test_features_change_the_gain_needed_by_two_octaves_at_most():
    for weight in (100.0, -100.0):
        silence = weighted("in_silence", "crowd", weight)
        least = 2.0 * 2.0 ** (-MOST_SILENCE if weight > 0.0 else MOST_SILENCE)
        assert np.isfinite(decisions([1.01 * least] * 2, silence)[0][0])
        assert np.isinf(decisions([0.99 * least] * 2, silence)[0][0])


def test_a_draw_may_speak_with_too_little_and_be_silent_with_enough():
    soft = PLAIN._replace(softness=np.array([[1.0]]))
    assert np.isinf(decisions([1.9] * 2, soft, chance=0.5)[0][0])
    assert np.isfinite(decisions([1.9] * 2, soft, chance=0.6)[0][0])
    assert np.isinf(decisions([2.1] * 2, soft, chance=0.4)[0][0])


def test_shifts_follow_the_slots_and_never_sense_farther_than_usual():
    assert [decisions([4.0] * 2, phase=n)[1][0] for n in (0, 1, 2, 5)] == [
        1.0,
        0.0,
        0.0,
        MOST_SHIFT_DB,
    ]
    loud = weighted("in_sensing_db", "crowd", 100.0)
    assert decisions([4.0] * 2, loud, phase=1)[1][0] == MOST_SENSED_DB


def test_a_robot_remembers_what_it_did():
    record = decisions([4.0] * 2, sent=[1])[2]
    assert record.since_sent[0].tolist() == [5.0, 0.0]
    assert record.sent_share[0].tolist() == [0.0, RECENT]
    assert record.decoded_share[0].tolist() == [RECENT, 0.0]
    assert record.news[0].tolist() == [6.0, 12.0]  # half of what the first learned is no news
    assert record.known[0].tolist() == [12.0, 12.0]
