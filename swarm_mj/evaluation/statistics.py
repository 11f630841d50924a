"""Statistics over missions: means with their errors, bootstrap intervals, quantiles of counts."""

import math

import numpy as np
from jaxtyping import Float, Int

CONFIDENCE = 0.95
RESAMPLES = 9999  # of a bootstrap; SciPy's own choice
BATCH = 1000  # resamples at once: bounds the memory that many samples take
RESAMPLING_SEED = 0  # the same samples have the same interval, wherever they come from
ROUNDING = 1e-12  # samples that differ by no more than this share of their size are constant


def spread(samples: Float[np.ndarray, "n"]) -> dict[str, float | None]:
    """Return mean, errors and quantiles of independent samples, one or more, in their own unit.

    `std` is the sample's standard deviation (n - 1 below), `sem` the mean's standard error,
    `ci_low` and `ci_high` the ends of `bootstrap_interval`; p95 is linear between samples.
    """
    ci_low, ci_high = bootstrap_interval(samples)
    return {
        "mean": float(np.mean(samples)),
        "std": float(np.std(samples, ddof=1)) if samples.size > 1 else None,
        "sem": standard_error(samples),
        "ci_low": ci_low,
        "ci_high": ci_high,
        "median": float(np.median(samples)),
        "p95": float(np.percentile(samples, 95.0)),
        "worst": float(np.max(samples)),
    }


def standard_error(samples: Float[np.ndarray, "n"]) -> float | None:
    """Return the mean's standard error, std / sqrt(n); None of fewer than two samples."""
    return float(np.std(samples, ddof=1)) / math.sqrt(samples.size) if samples.size > 1 else None


def bootstrap_interval(samples: Float[np.ndarray, "n"]) -> tuple[float | None, float | None]:
    """Return the bias-corrected and accelerated bootstrap interval of the mean (Efron 1987).

    The samples are independent; paired differences are one sample a pair. Both ends are None where
    the samples do not vary, or there is only one.
    """
    largest = float(np.max(np.abs(samples), initial=0.0))
    if samples.size < 2 or float(np.ptp(samples)) <= ROUNDING * largest:
        return None, None
    from scipy.stats import bootstrap  # takes its time to import

    found = bootstrap(
        (samples,),
        np.mean,
        confidence_level=CONFIDENCE,
        n_resamples=RESAMPLES,
        batch=BATCH,
        method="BCa",
        rng=np.random.default_rng(RESAMPLING_SEED),
    ).confidence_interval
    return float(found.low), float(found.high)


def quantile_of_counts(counts: Int[np.ndarray, "bins"], share: float) -> int:
    """Return the first bin at or below which at least this share of all counts lies."""
    return int(np.searchsorted(np.cumsum(counts), share * int(np.sum(counts))))
