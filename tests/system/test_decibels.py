"""Decibels by hand, there and back."""

import math

import numpy as np
import pytest

from swarm_mj.system.decibels import DB_PER_NEPER, from_db, to_db


def test_powers_by_hand():
    assert from_db(-50.0) == pytest.approx(1e-5)
    assert from_db(30.0) == pytest.approx(1000.0)  # 30 dBm is 1 W
    assert from_db(1.0) == pytest.approx(1.258925)
    assert pytest.approx(4.342945) == DB_PER_NEPER
    assert from_db(DB_PER_NEPER) == pytest.approx(math.e)


def test_arrays_there_and_back():
    ratio_db = np.array([-20.0, 0.0, 3.010299957])
    np.testing.assert_allclose(from_db(ratio_db), [0.01, 1.0, 2.0])
    np.testing.assert_allclose(to_db(from_db(ratio_db)), ratio_db, atol=1e-12)
