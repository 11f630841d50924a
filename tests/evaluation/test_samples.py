"""Statistics of samples, against hand arithmetic, a plain bootstrap and scipy."""

import math

import numpy as np
import pytest
import scipy.stats

from swarm_mj.evaluation.samples import (
    Sample,
    bootstrap_interval,
    quantile_of_counts,
    share_interval,
)


def test_the_interval_is_near_a_plain_bootstraps_and_students():
    samples = np.random.default_rng(1).normal(50.0, 10.0, size=100)
    low, high = bootstrap_interval(samples)
    rng = np.random.default_rng(2)
    means = [rng.choice(samples, 100).mean() for _ in range(4000)]
    student = scipy.stats.t.interval(0.95, 99, samples.mean(), scipy.stats.sem(samples))
    for expected in (np.percentile(means, [2.5, 97.5]), student):
        np.testing.assert_allclose([low, high], expected, atol=0.15)


def test_the_interval_of_skewed_samples_leans_to_their_tail():
    """What "bias-corrected and accelerated" is for."""
    samples = np.random.default_rng(3).lognormal(sigma=1.5, size=40)
    low, high = bootstrap_interval(samples)
    assert high - samples.mean() > 1.3 * (samples.mean() - low)


@pytest.mark.parametrize(
    "samples", [[7.0], [0.0, 0.0], [3.0] * 50, [0.1 + 0.2, 0.3, 0.3], [-5.0, -5.0]]
)
def test_samples_that_do_not_vary_have_no_interval(samples):
    assert bootstrap_interval(np.array(samples)) == (None, None)
    assert Sample(np.array(samples)).interval == (None, None)


def test_the_figures_of_a_sample_by_hand():
    """1, 2, 3, 6: the mean is 3, and its distances are 2, 1, 0, 3; their squares add up to 14."""
    sample = Sample(np.array([6.0, 1.0, 3.0, 2.0]))
    assert (sample.mean, sample.median, sample.worst) == (3.0, 2.5, 6.0)
    assert sample.std == pytest.approx((14.0 / 3.0) ** 0.5)
    assert sample.sem == pytest.approx((14.0 / 3.0) ** 0.5 / 2.0)
    assert sample.p95 == pytest.approx(3.0 + 0.85 * 3.0)
    assert sample.interval == bootstrap_interval(sample.values)


def test_without_samples_there_is_nothing():
    nothing = Sample(np.empty(0))
    assert (nothing.std, nothing.sem, nothing.interval) == (None, None, (None, None))
    for figure in (nothing.mean, nothing.median, nothing.p95, nothing.worst):
        assert math.isnan(figure)


@pytest.mark.parametrize(
    ("counts", "share", "expected"),
    [
        ([95, 5], 0.95, 0),  # exactly 95 % lie in bin 0
        ([94, 6], 0.95, 1),
        ([0, 0, 1], 0.95, 2),
        ([0, 3, 1, 0], 1.0, 2),
        ([0, 3, 1, 0], 0.0, 0),
    ],
)
def test_quantile_of_counts_by_hand(counts, share, expected):
    assert quantile_of_counts(np.array(counts), share) == expected


def test_a_share_s_interval_is_wilson_s():
    """By scipy's own; none held is no proof that none will."""
    for num_held, n in ((0, 10), (3, 10), (96, 100), (5, 5)):
        holds = np.arange(n) < num_held
        expected = scipy.stats.binomtest(num_held, n).proportion_ci(method="wilson")
        found = share_interval(holds)
        assert found == pytest.approx((expected.low, expected.high), rel=1e-6)
    assert share_interval(np.empty(0, dtype=bool)) == (None, None)
