"""What a log tells of its arrays, for three robots in two windows, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from swarm_mj.protocol.buffers import NO_PARENT
from swarm_mj.replay.log import Log

NAN = np.nan
# In the first window 0 asks 1, who answers; in the second, 2 transmits in the second slot only.
RECIPIENT = np.array([[[1, 1, 2], [0, 0, 2]], [[0, 1, 2], [0, 1, 0]]])


def log(*, is_broadcast=False, known_age=None, parent=None):
    """The arrays that these properties read; the observer is robot 0."""
    made = object.__new__(Log)
    facts = SimpleNamespace(is_broadcast=is_broadcast, observer=0)
    vars(made).update(facts=facts, recipient=RECIPIENT, known_age=known_age, parent=parent)
    return made


@pytest.mark.parametrize(
    ("is_broadcast", "transmits"),
    [
        (False, [[True, False, False], [False, False, False]]),  # answers are no requests
        (True, [[True, True, False], [False, False, True]]),  # both slots count
    ],
)
def test_who_transmits(is_broadcast, transmits):
    assert log(is_broadcast=is_broadcast).is_transmitter.tolist() == transmits


def test_the_observer_is_no_other_and_news_without_a_parent_did_not_come_by_radio():
    """It never heard of 1 at first; it knows 2 from the start, and 1 by 2 in the end."""
    known_age = np.array([[0.0, NAN, 3.0], [0.0, 1.0, 4.0]])
    parent = np.array([[0, 2, NO_PARENT], [0, 2, NO_PARENT]])
    its = log(known_age=known_age, parent=parent)
    assert its.is_other_known.tolist() == [[False, False, True], [False, True, True]]
    assert its.has_parent.tolist() == [[False, False, False], [False, True, False]]
