"""Mean powers by laws: hand arithmetic, slopes, and walls that add up."""

import math

import numpy as np
import pytest
from walls import walls

from swarm_mj.physics.state import Antennas
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


def drawn_antennas(num_robots, rng):
    """Heights up to 2 m, gains within 10 dB either way, powers down to a tenth."""
    return Antennas(
        height_m=rng.uniform(0.0, 2.0, num_robots),
        gain=10 ** rng.uniform(-1.0, 1.0, num_robots),
        power=10 ** rng.uniform(-1.0, 0.0, num_robots),
    )


@pytest.mark.parametrize(("breakpoint_at_1_m", "is_by_height"), [(40.0, False), (0.05, True)])
def test_mixed_antennas_against_a_loop_over_all_pairs(breakpoint_at_1_m, is_by_height):
    """Between antennas, not robots: with both gains, and beyond its own breakpoint d^-4."""
    rng = np.random.default_rng(1)
    position_m = rng.uniform(0.0, 60.0, (7, 3))
    antennas, at_1_m = drawn_antennas(7, rng), rng.uniform(1.0, 2.0, 7)
    law = PowerLaw(at_1_m, breakpoint_at_1_m, 4.0, antennas=antennas, is_by_height=is_by_height)
    power = powers_between(position_m, law)
    beyond = 0
    for i in range(7):
        for j in range(7):
            if i == j:
                continue
            x, y, z = position_m[j] - position_m[i]
            z += antennas.height_m[j] - antennas.height_m[i]
            d2 = x * x + y * y + z * z
            product = 1.0
            if is_by_height:
                product = position_m[i, 2] + antennas.height_m[i]
                product *= position_m[j, 2] + antennas.height_m[j]
            breakpoint_m = breakpoint_at_1_m * product
            expected = at_1_m[i] * antennas.gain[j] / d2
            if d2 > breakpoint_m**2:
                expected *= breakpoint_m**2 / d2
                beyond += 1
            assert power[i, j] == pytest.approx(expected)
    assert 0 < beyond < 42


def test_two_ray_of_two_heights_by_hand():
    """Rappaport's Eq. 4.52: received over sent is h_t² h_r² / d^4, 20 m and 0.5 m up."""
    at_1_m = 10 ** (-path_loss_db(1.0, FREQUENCY_HZ) / 10)
    breakpoint_m = two_ray_breakpoint_m(1.0, FREQUENCY_HZ)
    law = PowerLaw(np.full(2, at_1_m), breakpoint_m, 4.0, is_by_height=True)
    position_m = np.array([[0.0, 0.0, 20.0], [3000.0, 0.0, 0.5]])
    d2 = 3000.0**2 + 19.5**2
    power = powers_between(position_m, law)
    assert power[0, 1] == pytest.approx(20.0**2 * 0.5**2 / d2**2, rel=1e-3)
    assert power[0, 1] == power[1, 0]


def test_an_antenna_on_the_floor_counts_as_a_tenth_of_a_metre_high():
    law = PowerLaw(np.ones(2), 100.0, 4.0, is_by_height=True)
    power = powers_between(np.array([[0.0, 0.0, -0.5], [8.0, 0.0, 0.1]]), law)
    d2 = 8.0**2 + 0.6**2
    assert power[0, 1] == pytest.approx((100.0 * 0.1 * 0.1) ** 2 / d2**2)


def test_a_wall_is_in_the_way_of_antennas_not_of_robots():
    """Robots at 0.5 m look over a box 1 m high from 1.5 m."""
    low = walls(0.1, 0)
    low = low._replace(size_m=np.array([[1.0, 1e4, 1.0]]))
    position_m = np.array([[-10.0, 0.0, 0.5], [10.0, 0.0, 0.5]])
    masts = Antennas(height_m=np.ones(2), gain=np.ones(2), power=np.ones(2))
    behind = powers_between(position_m, PowerLaw(np.ones(2), obstacles=low))
    above = powers_between(position_m, PowerLaw(np.ones(2), obstacles=low, antennas=masts))
    assert behind[0, 1] == pytest.approx(0.1 / 400.0)
    assert above[0, 1] == pytest.approx(1.0 / 400.0)
