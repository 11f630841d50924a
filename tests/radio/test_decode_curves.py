import math

import numpy as np
import pytest
from scipy.stats import ncx2, norm

from swarm_mj.radio.decode_curves import decode_curves, probability_at, row_of
from swarm_mj.radio.fading import NO_FADING, NO_LINE_OF_SIGHT

MARGINS_DB = (-12.0, -3.1, 0.4, 2.3, 9.8)


def at(curves, margin_db, std_db=0.0):
    return probability_at(
        curves, int(row_of(np.full((1, 1), std_db))[0, 0]), 10.0 ** (margin_db / 10.0)
    )


def test_without_fades_a_packet_decodes_or_not():
    curves = decode_curves(NO_FADING)
    assert [at(curves, margin) for margin in (-30.0, -0.3, 0.0, 0.3, 60.0)] == [0, 0, 1, 1, 1]


@pytest.mark.parametrize("margin_db", MARGINS_DB)
def test_rayleigh_outage_is_exponential(margin_db):
    """P = exp(-threshold / SINR)."""
    expected = math.exp(-(10.0 ** (-margin_db / 10.0)))
    assert at(decode_curves(NO_LINE_OF_SIGHT), margin_db) == pytest.approx(expected, abs=4e-3)


@pytest.mark.parametrize("rician_k", [0.5, 4.0, 60.0, 400.0])
@pytest.mark.parametrize("margin_db", MARGINS_DB)
def test_rician_outage_is_that_of_the_noncentral_chi_square(rician_k, margin_db):
    """Twice the power over the scattered part has two degrees of freedom and noncentrality 2K."""
    least = 2.0 * (1.0 + rician_k) * 10.0 ** (-margin_db / 10.0)
    expected = ncx2.sf(least, 2, 2.0 * rician_k)
    assert at(decode_curves(rician_k), margin_db) == pytest.approx(expected, abs=2e-2)


@pytest.mark.parametrize("std_db", [1.0, 6.0])
@pytest.mark.parametrize("margin_db", MARGINS_DB)
def test_doubt_in_db_is_normal(std_db, margin_db):
    expected = norm.cdf(margin_db / std_db)
    assert at(decode_curves(NO_FADING), margin_db, std_db) == pytest.approx(expected, abs=0.03)


def test_doubt_and_fades_add_up():
    """Drawn by the thousands; the same share of packets is lost otherwise."""
    rng = np.random.default_rng(1)
    power_db = 10.0 * np.log10(rng.exponential(size=200_000)) + 3.0 * rng.normal(size=200_000)
    curves = decode_curves(NO_LINE_OF_SIGHT, success=0.7)
    for margin_db in MARGINS_DB:
        expected = 0.7 * np.mean(power_db + margin_db >= 0.0)
        assert at(curves, margin_db, 3.0) == pytest.approx(expected, abs=8e-3)
