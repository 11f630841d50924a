"""When a flock has agreed on a velocity, for good, and how fast it comes to that.

A *course* is a cost of missions after each window, [T B]: window 1 is its first row.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from swarm_mj.mission import Mission

AGREED = 0.01  # of the first window's velocity variance: a flock with less has agreed
E_FOLDINGS = 3  # of the velocity variance, from the first window on, over which a decay is measured

Course = Float[np.ndarray, "T B"]


def settled_window(course: Course, limit: float | Float[np.ndarray, "B"]) -> Float[np.ndarray, "B"]:
    """Return the first window from which on each mission's cost is below a limit, to the end.

    Args:
        course: The cost after each window, at least one; what is no number is not below.
        limit: In the cost's unit, of all missions or of each.

    Returns:
        Windows, counted from 1; nan where the cost is not below the limit at the end.
    """
    num_windows = len(course)
    is_over = ~(course < limit)
    last_over = num_windows - np.argmax(is_over[::-1], axis=0)  # counted from 1
    settled = np.where(np.any(is_over, axis=0), last_over + 1.0, 1.0)
    return np.where(settled <= num_windows, settled, np.nan)


def agreed_window(variance_m2ps2: Course) -> Float[np.ndarray, "B"]:
    """Return the first window from which on each mission's flock has agreed, to the end.

    Args:
        variance_m2ps2: Velocity variance after each window, at least one [m²/s²].

    Returns:
        Windows, counted from 1; nan where the flock has not agreed at the end, and of robots at
        rest.
    """
    return settled_window(variance_m2ps2, AGREED * variance_m2ps2[0])


class Decay(NamedTuple):
    """How fast a flock's velocity variance falls: as exp(-rate t)."""

    rate: Float[np.ndarray, "B"]  # [1/window]
    error: Float[np.ndarray, "B"]  # the rate's standard error [1/window]


def perfect_rate(window_s: float) -> float:
    """Return how fast a flock's velocity variance falls that knows itself perfectly [1/window].

    Each window multiplies the differences to the mean velocity by 1 - Δt (Eqs. 15 and 16): in one
    of 1 s they are gone, and the rate is inf; beyond, they change sign, and from 2 s on nothing of
    them goes: 0.

    Args:
        window_s: Δt, the window's length [s], more than 0.
    """
    left = abs(1.0 - window_s)
    if left == 0.0:
        return math.inf
    return -2.0 * math.log(min(left, 1.0))


def perfect_variance(mission: Mission) -> Float[np.ndarray, "T"]:
    """Return the velocity variance of a flock that knows itself perfectly, over its windows.

    It is the mean over missions. Start velocities are uniform within plus or minus V_max along each
    of two axes; about their own team's mean, 1 - 1 / N of their variance is left. From there it
    falls at `perfect_rate`.

    Args:
        mission: A flock's; that other tasks share news changes nothing about their velocities.

    Returns:
        The velocity variance after each window [m²/s²].
    """
    per_axis = mission.max_velocity_mps**2 / 3.0
    start = 2.0 * per_axis * (1.0 - 1.0 / mission.num_robots)
    window = np.arange(1, mission.num_windows + 1)
    return start * np.exp(-perfect_rate(mission.window_s) * window)


def decay(variance_m2ps2: Course) -> Decay:
    """Return how fast each mission's velocity variance falls, over its first three e-foldings.

    A line is fitted to the logarithm from the first window to the first in which under 5 %, which
    is exp(-3), of the first variance is left. With perfect knowledge it falls at `perfect_rate`.

    Args:
        variance_m2ps2: Velocity variance after each window, at least one [m²/s²].

    Returns:
        The rate, and its standard error; both are nan where less than three windows lead so far,
        or none does.
    """
    num_missions = variance_m2ps2.shape[1]
    rate = np.full(num_missions, np.nan)
    error = np.full(num_missions, np.nan)
    for b in range(num_missions):
        variance = variance_m2ps2[:, b]
        is_past = variance < math.exp(-E_FOLDINGS) * variance[0]
        last = int(np.argmax(is_past))
        fallen = variance[: last + 1]
        if last >= 2 and np.all(fallen > 0.0):  # two windows leave no error; 0 has no logarithm
            rate[b], error[b] = _slope(np.log(fallen))
    return Decay(rate=-rate, error=error)


def _slope(values: Float[np.ndarray, "n"]) -> tuple[float, float]:
    """Return the slope of values over their places, by least squares, and its standard error."""
    place = np.arange(len(values)) - (len(values) - 1) / 2.0
    spread = float(np.sum(place**2))
    slope = float(np.sum(place * values)) / spread
    residual = values - np.mean(values) - slope * place
    error = math.sqrt(float(np.sum(residual**2)) / (len(values) - 2) / spread)
    return slope, error
