"""Choices and answers that are refused, and that a user's channel cannot move what it is shown."""

from functools import partial

import numpy as np
import pytest

from swarm_mj.protocol.checks import checked_decode, checked_robots
from swarm_mj.radio.free_space import FreeSpaceRadio

POSITION_M = np.zeros((1, 4, 2))
RECIPIENT = np.array([[1, 1, -1, 3]])  # 0 addresses 1, 2 broadcasts; 1 and 3 are silent


@pytest.mark.parametrize("nobody", [-2, 3])
@pytest.mark.parametrize(("b", "i"), [(0, 0), (0, 2), (1, 1)])
def test_choices_that_are_no_robots_are_refused(b, i, nobody):
    recipient = np.array([[0, 1, 2], [2, 1, 0]])
    checked_robots("recipient", recipient, (2, 3))
    recipient[b, i] = nobody
    said = f"recipient of robot {i} in mission {b} must be from 0 to 2, not {nobody}"
    with pytest.raises(ValueError, match=said):
        checked_robots("recipient", recipient, (2, 3), may_broadcast=True)


def test_everyone_is_a_choice_only_where_robots_may_broadcast():
    checked_robots("recipient", np.array([[-1, 1]]), (1, 2), may_broadcast=True)
    with pytest.raises(ValueError, match="from 0 to 1, not -1"):
        checked_robots("recipient", np.array([[-1, 1]]), (1, 2))


@pytest.mark.parametrize("kind", ["int8", "uint8", "<i4", ">i4", ">i8", ">u2", "uint64"])
def test_integers_of_any_width_and_byte_order_are_those_of_compiled_loops(kind):
    """Byte-swapped ones were an error of numba's, twenty lines long."""
    chosen = checked_robots("recipient", np.array([[2, 0, 1]], dtype=kind), (1, 3))
    assert chosen.dtype == np.int64
    assert chosen.dtype.isnative
    assert chosen.tolist() == [[2, 0, 1]]


def test_the_largest_unsigned_integer_is_no_broadcast():
    largest = np.array([[0, 2**64 - 1]], dtype=np.uint64)
    with pytest.raises(ValueError, match=f"from 0 to 1, not {2**64 - 1}"):
        checked_robots("recipient", largest, (1, 2), may_broadcast=True)


def test_lists_of_different_lengths_are_refused():
    with pytest.raises(ValueError, match="recipient must be an array, or lists of the same length"):
        checked_robots("recipient", [[0, 1], [2]], (2, 2))


@pytest.mark.parametrize("kind", [float, bool])
def test_robots_are_named_by_integers(kind):
    with pytest.raises(ValueError, match=f"must be integers from 0 to 1, not {kind.__name__}"):
        checked_robots("recipient", np.array([[0, 1]], dtype=kind), (1, 2))


def answering(*heard):
    def answer(_position_m, _recipient, wanted):
        return wanted

    return partial(answer, wanted=np.array([heard]))


def test_a_robot_that_transmits_may_be_decoded_by_one_that_does_too():
    heard = checked_decode(answering(2, 0, 0, 2), POSITION_M, RECIPIENT)
    assert heard.tolist() == [[2, 0, 0, 2]]


@pytest.mark.parametrize(
    ("heard", "complaint"),
    [
        ((0, 3, 2, 3), "channel answer let robot 1 in mission 0 decode robot 3, which is silent;"),
        ((0, 1, 2, 1), "channel answer let robot 3 in mission 0 decode robot 1, which is silent;"),
        ((0, 1, 2, 4), "channel answer: sender heard of robot 3 in mission 0 must be from 0 to 3"),
        ((0.0, 1.0, 2.0, 3.0), "channel answer: sender heard must be integers from 0 to 3, not fl"),
        ((0, 1), r"channel answer: sender heard must have shape \(1, 4\), missions by robots"),
    ],
)
def test_what_no_radio_does_is_refused(heard, complaint):
    with pytest.raises(ValueError, match=complaint):
        checked_decode(answering(*heard), POSITION_M, RECIPIENT)


def test_a_radio_made_from_the_package_s_is_a_user_s_own():
    class Wishful(FreeSpaceRadio):
        def __call__(self, _position_m, recipient):
            return np.full_like(recipient, 3)

    wishful = Wishful(power_mw=1.0, noise_mw=1.0, threshold=1.0, frequency_hz=2.4e9)
    with pytest.raises(ValueError, match=r"channel Wishful let robot 0 .* which is silent"):
        checked_decode(wishful, POSITION_M, RECIPIENT)


def test_it_may_write_what_it_gets():
    def writes(position_m, recipient):
        heard = recipient.copy()
        position_m += 7.0
        recipient[:] = 2
        return np.where(heard == -1, 2, np.arange(4))

    assert checked_decode(writes, POSITION_M, RECIPIENT).tolist() == [[0, 1, 2, 3]]
    assert np.all(POSITION_M == 0.0)
    assert RECIPIENT.tolist() == [[1, 1, -1, 3]]
