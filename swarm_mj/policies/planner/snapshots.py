"""Pictures of the team: what the planner's robots agree on.

Index order: row `i` of every array is robot i's picture, column `k` what it says about robot k.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

FORESIGHT = 15.0  # windows that a robot is expected to keep its velocity for
# Where nobody moves and fewer than this share are fresh, robots are not lost but fly by plans that
# differ; pictures of the same places must then come to the same plan, whoever is fresh in them.
WHOLE = 0.75
SPREAD = 0.45  # of the distance that robots apart in velocity cover: how far beliefs are off


@dataclass(frozen=True, kw_only=True)
class Pictures:
    """What each robot i believed of every robot k when the epoch began: one picture a robot.

    A picture is never changed; packets carry it whole, so i's name stands for it.
    """

    is_known: Bool[np.ndarray, "N N"]  # whether i had ever heard of k
    is_fresh: Bool[np.ndarray, "N N"]  # whether that was not too long ago
    position_m: Float[np.ndarray, "N N 2"]  # where k will be amid the epoch it is made for [m]
    spread_m: Float[np.ndarray, "N N"]  # standard deviation of that, per axis [m]
    timestamp: Float[np.ndarray, "N N"]  # when k observed what is believed of it [windows]
    rank: Int[np.ndarray, "N"]  # the best picture has rank 0


def freeze(
    position_m: Float[np.ndarray, "N N 2"],
    velocity_mps: Float[np.ndarray, "N N 2"],
    timestamp: Float[np.ndarray, "N N"],
    is_known: Bool[np.ndarray, "N N"],
    now: float,
    window_s: float,
    windows_ahead: float,
    fresh_windows: float,
) -> Pictures:
    """Every robot's picture, row i from buffer i alone.

    Args:
        position_m: M^{i,k}: positions [m].
        velocity_mps: M^{i,k}: velocities [m/s].
        timestamp: T^{i,k} [windows].
        is_known: Whether i has heard of k.
        now: t [windows].
        window_s: Duration of a window [s].
        windows_ahead: How far ahead the middle of the epoch is that they are made for [windows].
        fresh_windows: Age up to which a robot counts as fresh [windows].

    Returns:
        The pictures; the best has most robots fresh, then the least mean age of these, then the
        lowest identity.
    """
    num_known = np.sum(is_known, axis=1)
    age = np.where(is_known, now - timestamp, 0.0)
    ahead = age + windows_ahead
    mean_mps = np.sum(velocity_mps * is_known[..., None], axis=1) / num_known[:, None]
    apart_mps = (velocity_mps - mean_mps[:, None]) * is_known[..., None]
    variance = np.sum(apart_mps**2, axis=(1, 2)) / num_known
    is_fresh = is_known & (age <= fresh_windows)
    num_fresh = np.maximum(np.sum(is_fresh, axis=1), 1)  # a robot that is off grows old to itself
    spread_m = SPREAD * np.sqrt(variance)[:, None] * window_s * ahead
    rests = np.all(is_known, axis=1) & ~np.any(spread_m, axis=1)
    is_divided = rests & (num_fresh < WHOLE * is_known.shape[1])
    return Pictures(
        is_known=is_known.copy(),
        is_fresh=is_fresh | is_divided[:, None],
        position_m=position_m + velocity_mps * np.minimum(ahead, FORESIGHT)[..., None] * window_s,
        spread_m=spread_m,
        timestamp=timestamp.copy(),
        rank=np.argsort(np.lexsort((np.sum(age * is_fresh, axis=1) / num_fresh, -num_fresh))),
    )
