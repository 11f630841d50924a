"""Intervals that hold whenever one stops, against coins that are thrown and by numbers of old."""

import numpy as np
import pytest
from scipy.integrate import quad

from swarm_mj.evaluation.sequential import log_evidence, share_bounds

SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    "share", [pytest.param(0.5, marks=SLOW), pytest.param(0.8, marks=SLOW), 0.97]
)
def test_the_true_share_is_hardly_ever_outside_at_any_time(share):
    """One look at every fourth of 200 missions; a fixed interval of 95 % would be wrong in 30 %."""
    rng = np.random.default_rng(4)
    known: dict[tuple[int, int], bool] = {}
    num_wrong = 0
    for _ in range(200):
        num_held = np.cumsum(rng.random(200) < share)
        is_wrong = False
        for n in range(1, 201, 4):
            counted = int(num_held[n - 1]), n
            if counted not in known:
                low, high = share_bounds(*counted, 0.95)
                known[counted] = not low <= share <= high
            is_wrong |= known[counted]
        num_wrong += is_wrong
    assert num_wrong / 200 <= 0.05


@pytest.mark.parametrize(("num_held", "num_failed"), [(3, 0), (12, 5), (0, 4), (40, 40)])
@pytest.mark.parametrize("share", [0.2, 0.7])
def test_the_evidence_is_a_mean_of_likelihoods(num_held, num_failed, share):
    def likelihood(p):
        return p**num_held * (1.0 - p) ** num_failed

    mixed, _ = quad(likelihood, share, 1.0, epsrel=1e-12)
    factor = mixed / (1.0 - share) / likelihood(share)
    assert np.exp(log_evidence(num_held, num_failed, share)) == pytest.approx(factor, rel=1e-6)


@pytest.mark.parametrize("share", [0.3, 0.8])
def test_the_evidence_has_a_mean_of_one_while_the_claim_is_just_not_true(share):
    """After any number of missions: what makes looking at each of them safe."""
    for n in (1, 6):
        mean = 0.0
        for held in range(n + 1):
            ways = float(np.prod(np.arange(n - held + 1, n + 1)) / np.prod(np.arange(1, held + 1)))
            probability = ways * share**held * (1.0 - share) ** (n - held)
            mean += probability * np.exp(log_evidence(held, n - held, share))
        assert mean == pytest.approx(1.0)


def test_bounds_close_in_and_mirror_each_other():
    before = (0.0, 1.0)
    for n in (10, 100, 1000, 100_000):
        low, high = share_bounds(9 * n // 10, n, 0.95)
        assert before[0] < low < 0.9 < high < before[1]
        mirrored = share_bounds(n - 9 * n // 10, n, 0.95)
        assert mirrored == pytest.approx((1.0 - high, 1.0 - low))
        before = low, high
    assert before == pytest.approx((0.9, 0.9), abs=0.01)


def test_nothing_held_or_all_did():
    low, high = share_bounds(0, 50, 0.95)
    assert low == 0.0
    assert 0.05 < high < 0.15
    assert share_bounds(50, 50, 0.95) == pytest.approx((1.0 - high, 1.0))
    assert share_bounds(1, 1, 0.999999) == (pytest.approx(0.0, abs=1e-5), 1.0)


def test_a_higher_level_is_wider():
    sure = share_bounds(40, 50, 0.99)
    usual = share_bounds(40, 50, 0.95)
    assert sure.low < usual.low < 0.8 < usual.high < sure.high
