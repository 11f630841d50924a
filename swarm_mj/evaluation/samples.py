"""Statistics of independent samples: mean, errors, quantiles, and intervals of 95 %."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int, Shaped

BATCH = 1000  # resamples at once: bounds the memory that many samples take
NORMAL_95 = 1.959964  # standard deviations about the mean that hold 95 % of a normal distribution
ROUNDING = 1e-12  # samples that differ by no more than this share of their size are constant


class Interval(NamedTuple):
    """Both ends of an interval of 95 %, of a mean or a share; None where there is none."""

    low: float | None
    high: float | None


@dataclass(frozen=True, eq=False)
class Sample:
    """Independent samples, in their own unit: one of each mission, say.

    Without any, the mean and the quantiles are nan, and there is neither an error nor an interval.
    """

    values: Float[np.ndarray, "n"]

    @property
    def mean(self) -> float:
        """The mean."""
        return float(np.mean(self.values)) if self.values.size else math.nan

    @property
    def std(self) -> float | None:
        """The sample's standard deviation (n - 1 below); None of fewer than two samples."""
        return float(np.std(self.values, ddof=1)) if self.values.size > 1 else None

    @property
    def sem(self) -> float | None:
        """The mean's standard error."""
        return standard_error(self.values)

    @cached_property
    def interval(self) -> Interval:
        """The mean's interval; it is made once, as thousands of resamples take a moment."""
        return bootstrap_interval(self.values)

    @property
    def median(self) -> float:
        """The median."""
        return float(np.median(self.values)) if self.values.size else math.nan

    @property
    def p95(self) -> float:
        """The 95th percentile, linear between samples."""
        return float(np.percentile(self.values, 95.0)) if self.values.size else math.nan

    @property
    def worst(self) -> float:
        """The largest."""
        return float(np.max(self.values)) if self.values.size else math.nan


def standard_error(samples: Float[np.ndarray, "n"]) -> float | None:
    """Return the mean's standard error, std / sqrt(n); None of fewer than two samples."""
    if samples.size < 2:
        return None
    return float(np.std(samples, ddof=1)) / math.sqrt(samples.size)


def bootstrap_interval(samples: Float[np.ndarray, "n"]) -> Interval:
    """Return the mean's bias-corrected and accelerated bootstrap interval, 95 % (Efron 1987).

    Args:
        samples: Independent ones, [n]; paired differences are one sample a pair.

    Returns:
        Both ends, in the samples' unit; None where the samples do not vary, or there is only one.
    """
    largest = float(np.max(np.abs(samples), initial=0.0))
    if samples.size < 2 or float(np.ptp(samples)) <= ROUNDING * largest:
        return Interval(None, None)
    from scipy.stats import bootstrap  # slow to import

    rng = np.random.default_rng(0)  # the same samples always have the same interval
    found = bootstrap((samples,), np.mean, batch=BATCH, rng=rng).confidence_interval
    return Interval(float(found.low), float(found.high))


def share_interval(holds: Shaped[np.ndarray, "n"]) -> Interval:
    """Return the interval of 95 % of a share of missions (Wilson 1927); None without missions.

    Args:
        holds: Whether what is counted holds in each mission, [n].
    """
    n = holds.size
    if n == 0:
        return Interval(None, None)
    share = float(np.mean(holds))
    # The share and one half, weighed by the missions and by what stands for the prior doubt.
    weight = n / (n + NORMAL_95**2)
    centre = weight * share + (1.0 - weight) / 2.0
    spread = share * (1.0 - share) / n + NORMAL_95**2 / (4.0 * n**2)
    half = weight * NORMAL_95 * math.sqrt(spread)
    return Interval(max(0.0, centre - half), min(1.0, centre + half))


def quantile_of_counts(counts: Int[np.ndarray, "bins"], share: float) -> int:
    """Return the first bin at or below which at least this share of all counts lies.

    Args:
        counts: How often each bin was met, [bins], from 0 on.
        share: From 0 to 1; 0.5 gives the median's bin.
    """
    return int(np.searchsorted(np.cumsum(counts), share * int(np.sum(counts))))
