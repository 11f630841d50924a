"""Mean powers by laws: hand arithmetic, slopes, and walls that add up."""

import math

import numpy as np
import pytest
from walls import walls

from swarm_mj.radio.free_space import path_loss_db
from swarm_mj.radio.power_law import PowerLaw, power_after, powers_between, two_ray_breakpoint_m

PLACES_M = np.array([[-30.0, 0.0], [-40.0, 0.0], [30.0, 40.0]])


def test_free_space_is_the_inverse_square_by_hand():
    """10 m, sqrt(60² + 40²) m and sqrt(70² + 40²) m apart; robot 2 sends four times the power."""
    power = powers_between(PLACES_M, PowerLaw(np.array([1.0, 1.0, 4.0])))
    expected = [[0.0, 1 / 100, 1 / 5200], [1 / 100, 0.0, 1 / 6500], [4 / 5200, 4 / 6500, 0.0]]
    np.testing.assert_allclose(power, expected, rtol=1e-12)


def test_a_steeper_law_and_a_wall_by_hand():
    """Beyond 20 m the fourth power: 1/20² (20/d)⁴; a tenth is left behind the wall."""
    law = PowerLaw(np.ones(3), 20.0, 4.0, walls(0.1, 0))
    power = powers_between(PLACES_M, law)
    assert power[0, 1] == pytest.approx(1 / 100)
    assert power[0, 2] == pytest.approx(0.1 * 20.0**2 / 5200.0**2)
    assert power[2, 1] == pytest.approx(0.1 * 20.0**2 / 6500.0**2)


FREQUENCY_HZ = 2.4e9


def loss_db(distance_m, breakpoint_m, exponent):
    """Between transmit power and what is left."""
    at_1_m = 10 ** (-path_loss_db(1.0, FREQUENCY_HZ) / 10)
    return -10 * math.log10(power_after(at_1_m, distance_m**2, breakpoint_m, exponent))


@pytest.mark.parametrize(("near_m", "slope_db"), [(0.2, 20.0), (20.0, 35.0), (300.0, 35.0)])
def test_log_distance_has_its_slope_beyond_the_breakpoint_and_free_spaces_before(near_m, slope_db):
    slope = loss_db(10 * near_m, 20.0, 3.5) - loss_db(near_m, 20.0, 3.5)
    assert slope == pytest.approx(slope_db)


def test_two_ray_loses_d4_over_h4_beyond_4_pi_h2_over_lambda():
    """Rappaport's Eq. 4.52, with antennas without gain: the loss is d^4 / (h^2 h^2)."""
    wavelength_m = 299_792_458.0 / FREQUENCY_HZ
    breakpoint_m = two_ray_breakpoint_m(1.5, FREQUENCY_HZ)
    assert breakpoint_m == pytest.approx(4 * math.pi * 1.5**2 / wavelength_m)
    expected_db = 10 * math.log10(500.0**4 / 1.5**4)
    assert loss_db(500.0, breakpoint_m, 4.0) == pytest.approx(expected_db, abs=0.01)
