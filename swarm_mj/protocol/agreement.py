"""When a flock has agreed on a velocity: hardly any velocity variance is left, for good."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

AGREED = 0.01  # of the first window's velocity variance: a flock with less has agreed


def has_agreed(
    variance_m2ps2: Float[np.ndarray, "B"], first_m2ps2: Float[np.ndarray, "B"]
) -> Bool[np.ndarray, "B"]:
    """Return whether a window's velocity variance is under 1 % of the first window's.

    Args:
        variance_m2ps2: After the window, of each mission (IV-A) [m²/s²].
        first_m2ps2: After the first window [m²/s²]; robots at rest, with 0, never agree.
    """
    return variance_m2ps2 < AGREED * first_m2ps2


def agreed_window(variance_m2ps2: Sequence[Float[np.ndarray, "B"]]) -> Float[np.ndarray, "B"]:
    """Return the first window from which on each mission's flock has agreed, to the end.

    Args:
        variance_m2ps2: After each window, in order, at least one [m²/s²].

    Returns:
        Windows, counted from 1; nan where the flock has not agreed at the end.
    """
    since = np.full(len(variance_m2ps2[0]), np.nan)
    for window, variance in enumerate(variance_m2ps2, start=1):
        has = has_agreed(variance, variance_m2ps2[0])
        since = agreed_since(since, np.where(has, float(window), np.nan))
    return since


def agreed_since(
    before: Float[np.ndarray, "B"], window: Float[np.ndarray, "B"]
) -> Float[np.ndarray, "B"]:
    """Return since when flocks have agreed, after another window.

    Args:
        before: Since when they had, after the windows before; nan if they had not.
        window: The window's number where they have agreed in it, nan elsewhere.
    """
    return np.where(np.isnan(before) | np.isnan(window), window, before)
