"""A share of missions, estimated while they fly: certain whenever one stops.

Fixed-size intervals are wrong more often than they say if one looks at them again and again, and
stops as soon as they please. These may be looked at after every mission.
"""

from typing import NamedTuple

import numpy as np


class ShareBounds(NamedTuple):
    """Both ends of a share's interval, from 0 to 1."""

    low: float
    high: float


def share_bounds(num_held: int, num_missions: int, level: float) -> ShareBounds:
    """Return an interval that holds the true share, at every number of missions at once.

    The bounds are those shares against which the missions are too strong evidence: for which the
    likelihood, mixed over all shares beyond with equal weights, is 2 / (1 - level) times larger. By
    Ville's inequality, the true share is ever outside with a probability of at most 1 - level
    (Robbins 1970).

    Args:
        num_held: Missions in which what is checked held.
        num_missions: Of how many, in the order of their seeds.
        level: Such as 0.95.

    Returns:
        Both ends.
    """
    num_failed = num_missions - num_held
    low = _lower_bound(num_held, num_failed, level)
    high = 1.0 - _lower_bound(num_failed, num_held, level)
    return ShareBounds(low, high)


def _lower_bound(num_held: int, num_failed: int, level: float) -> float:
    """Return the least share that the missions do not refute."""
    if num_held == 0:
        return 0.0
    from scipy.optimize import root_scalar  # slow to import

    needed = np.log(2.0 / (1.0 - level))

    def excess(share: float) -> float:
        return log_evidence(num_held, num_failed, share) - needed

    least = 1e-12
    found = num_held / (num_held + num_failed)
    if excess(least) <= 0.0:  # one mission of many, at a level near 1
        return 0.0
    # At the share found, the missions are no evidence at all; below it, the less the more.
    highest = min(found, 1.0 - least)
    if excess(highest) >= 0.0:  # after millions of missions, the two are one number
        return highest
    return float(root_scalar(excess, bracket=(least, highest)).root)


def log_evidence(num_held: int, num_failed: int, share: float) -> float:
    """Return how strongly missions speak for more than a share: the logarithm of a factor.

    The factor is the likelihood of the missions, a mean over all shares from `share` to 1, over
    their likelihood at `share`. While the true share is not above it, the factor has a mean of at
    most 1 after any number of missions, and is a supermartingale.

    Args:
        num_held: Missions in which what is checked held.
        num_failed: All others.
        share: Above 0, below 1.
    """
    from scipy.special import betaincc, betaln  # slow to import

    # All shares were alike before; this is how likely those above `share` are after the missions.
    above = betaincc(num_held + 1, num_failed + 1, share)
    mixed = betaln(num_held + 1, num_failed + 1) + np.log(above) - np.log1p(-share)
    own = num_held * np.log(share) + num_failed * np.log1p(-share)
    return float(mixed - own)
