"""Places of names: in order, apart, inside, and as near to where they want to be as that allows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from swarm_mj.evaluation.figures.labels import spread

WANTED = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12).map(np.array)


def test_names_with_room_stay_where_they_are():
    np.testing.assert_allclose(spread(np.array([0.9, 0.1, 0.5]), 0.1), [0.9, 0.1, 0.5])


def test_two_in_one_place_part_by_half_a_gap_each():
    np.testing.assert_allclose(spread(np.array([0.5, 0.5]), 0.2), [0.4, 0.6])


def test_at_the_ends_they_stay_inside():
    np.testing.assert_allclose(spread(np.array([1.0, 1.0, 0.0]), 0.2), [0.8, 1.0, 0.0])


@given(WANTED)
def test_they_keep_their_order_and_distance(wanted):
    gap = 0.05
    places = spread(wanted, gap)
    order = np.argsort(wanted, kind="stable")
    assert np.all(np.diff(places[order]) >= gap - 1e-12)
    assert np.all((places >= -1e-12) & (places <= 1.0 + 1e-12))


@pytest.mark.parametrize("seed", range(5))
def test_they_are_as_near_as_can_be(seed):
    """Against a general solver of the same least squares."""
    rng, gap = np.random.default_rng(seed), 0.11
    wanted = np.sort(rng.uniform(0.0, 1.0, size=7))
    apart = {"type": "ineq", "fun": lambda places: np.diff(places) - gap}
    solved = minimize(
        lambda places: np.sum((places - wanted) ** 2),
        np.linspace(0.0, 1.0, 7),
        bounds=[(0.0, 1.0)] * 7,
        constraints=apart,
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    np.testing.assert_allclose(spread(wanted, gap), solved.x, atol=1e-5)


def test_more_than_fit_keep_their_distance():
    np.testing.assert_allclose(spread(np.array([0.0, 0.5, 1.0]), 1.0), [0.0, 1.0, 2.0])
