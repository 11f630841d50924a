"""Path loss against its slopes, and the compiled power against the loss in dB."""

import math

import pytest

from swarm_mj.radio.free_space import path_loss_db
from swarm_mj.radio.path_loss import FREE_SPACE, log_distance, power_after, two_ray_ground

FREQUENCY_HZ = 2.4e9


def slope_db_per_decade(law, distance_m):
    return law.loss_db(10 * distance_m, FREQUENCY_HZ) - law.loss_db(distance_m, FREQUENCY_HZ)


def test_free_space_is_the_papers():
    for distance_m in (0.5, 1.0, 250.0, 4000.0):
        assert FREE_SPACE.loss_db(distance_m, FREQUENCY_HZ) == path_loss_db(
            distance_m, FREQUENCY_HZ
        )


def test_log_distance_has_its_slope_beyond_the_reference_and_free_spaces_before():
    law = log_distance(3.5, 20.0)
    assert slope_db_per_decade(law, 0.2) == pytest.approx(20.0)
    assert slope_db_per_decade(law, 20.0) == pytest.approx(35.0)
    assert slope_db_per_decade(law, 300.0) == pytest.approx(35.0)


def test_two_ray_loses_40_db_per_decade_far_out_and_d4_over_h4_exactly():
    """Rappaport's Eq. 4.52, with antennas without gain: the loss is d^4 / (h^2 h^2)."""
    law = two_ray_ground(1.5, FREQUENCY_HZ)
    assert slope_db_per_decade(law, 500.0) == pytest.approx(40.0)
    expected_db = 10 * math.log10(500.0**4 / 1.5**4)
    assert law.loss_db(500.0, FREQUENCY_HZ) == pytest.approx(expected_db, abs=0.01)


def test_two_ray_crosses_over_at_4_pi_h2_over_lambda():
    wavelength_m = 299_792_458.0 / FREQUENCY_HZ
    assert two_ray_ground(2.0, FREQUENCY_HZ).breakpoint_m == pytest.approx(
        4 * math.pi * 4.0 / wavelength_m
    )


@pytest.mark.parametrize(
    "law", [FREE_SPACE, log_distance(2.9, 10.0), two_ray_ground(1.0, FREQUENCY_HZ)]
)
def test_the_power_left_is_what_the_loss_leaves(law):
    for distance_m in (2.0, 9.9, 10.1, 150.0, 900.0):
        at_1_m = 10 ** (-path_loss_db(1.0, FREQUENCY_HZ) / 10)
        left = power_after(at_1_m, distance_m**2, law.breakpoint_m, law.exponent)
        expected = 10 ** (-law.loss_db(distance_m, FREQUENCY_HZ) / 10)
        assert left == pytest.approx(expected, rel=1e-9)
