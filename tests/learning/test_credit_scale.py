"""What credits usually are, in one kind of mission: by hand, and as a law."""

import math

import numpy as np
import pytest

from swarm_mj.learning.credit_scale import KEPT, CreditScale


def as_credits(*numbers):
    return np.array(numbers, dtype=np.float32)


def test_credits_are_divided_by_their_root_mean_square_by_hand():
    """Those of silent robots do not count; a window before this one counts a little less."""
    scale = CreditScale()
    first = scale.divided(as_credits(3.0, 0.0, -4.0))
    root = math.sqrt((9.0 + 16.0) / 2.0)
    np.testing.assert_allclose(first, [3.0 / root, 0.0, -4.0 / root], rtol=1e-6)
    second = scale.divided(as_credits(0.0, 12.0, 0.0))
    root = math.sqrt((KEPT * 25.0 + 144.0) / (KEPT * 2.0 + 1.0))
    np.testing.assert_allclose(second, [0.0, 12.0 / root, 0.0], rtol=1e-6)
    assert second.dtype == np.float32


def test_where_nobody_has_spoken_there_is_no_scale():
    scale = CreditScale()
    assert scale.divided(as_credits(0.0, 0.0)).tolist() == [0.0, 0.0]
    assert scale.divided(as_credits(0.0, 2.0)).tolist() == [0.0, 1.0]


@pytest.mark.parametrize("size", [0.01, 50.0])
def test_credits_of_any_size_come_out_alike_and_a_change_is_followed(size):
    scale = CreditScale()
    rng = np.random.default_rng(1)
    for factor in (1.0, 10.0):
        squares = []
        for _ in range(6000):
            credit = (factor * size * rng.standard_normal(8)).astype(np.float32)
            squares.append(np.mean(scale.divided(credit) ** 2))
        assert np.mean(squares[-2000:]) == pytest.approx(1.0, abs=0.05)
