"""Pictures of the team, and the plans that follow from them: what the planner's robots agree on.

Index order: row `i` of every array is robot i's picture, column `k` what it says about robot k.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.policies.schedule import greedy_schedule, links_between
from swarm_mj.radio import FreeSpaceRadio

SHORTEST_EPOCH = 10  # windows; longer for teams above twice that
FORESIGHT = 15.0  # windows that a robot is expected to keep its velocity for
SPREAD = 0.45  # of the distance that robots apart in velocity cover: how far beliefs are off


@dataclass(frozen=True, kw_only=True)
class Pictures:
    """What each robot i believed of every robot k when the epoch began: one picture a robot.

    A picture is never changed; packets carry it whole, so i's name stands for it.
    """

    is_known: Bool[np.ndarray, "N N"]  # whether k is in i's picture
    position_m: Float[np.ndarray, "N N 2"]  # where k will be amid the epoch it is made for [m]
    spread_m: Float[np.ndarray, "N N"]  # standard deviation of that, per axis [m]
    rank: Int[np.ndarray, "N"]  # the best picture has rank 0


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What follows from a picture."""

    recipient: Int[np.ndarray, "E N"]  # whom each robot addresses in each window of the epoch
    timestamp: Float[np.ndarray, "N N"]  # T after the epoch, as expected [windows]
    is_complete: bool  # whether the picture had all robots


def epoch_windows(num_robots: int) -> int:
    """Length of an epoch: long enough for a picture to reach all of a team [windows]."""
    return max(SHORTEST_EPOCH, num_robots // 2)


def freeze(
    position_m: Float[np.ndarray, "N N 2"],
    velocity_mps: Float[np.ndarray, "N N 2"],
    timestamp: Float[np.ndarray, "N N"],
    is_known: Bool[np.ndarray, "N N"],
    now: float,
    window_s: float,
    windows_ahead: float,
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

    Returns:
        The pictures.
    """
    num_known = np.sum(is_known, axis=1)
    age = np.where(is_known, now - timestamp, 0.0)
    ahead = age + windows_ahead
    mean_mps = np.sum(velocity_mps * is_known[..., None], axis=1) / num_known[:, None]
    apart_mps = (velocity_mps - mean_mps[:, None]) * is_known[..., None]
    variance = np.sum(apart_mps**2, axis=(1, 2)) / num_known
    return Pictures(
        is_known=is_known.copy(),
        position_m=position_m + velocity_mps * np.minimum(ahead, FORESIGHT)[..., None] * window_s,
        spread_m=SPREAD * np.sqrt(variance)[:, None] * window_s * ahead,
        rank=np.argsort(np.lexsort((np.sum(age, axis=1) / num_known, -num_known))),
    )


def make_plan(
    radio: FreeSpaceRadio,
    pictures: Pictures,
    whose: int,
    timestamp: Float[np.ndarray, "N N"],
    now: float,
) -> Plan:
    """What the epoch that begins now should be, by one picture; it depends on nothing else.

    Args:
        radio: The mission's channel.
        pictures: The pictures made for this epoch.
        whose: The robot whose picture counts.
        timestamp: T as the epoch begins, as far as is known with that picture [windows].
        now: t as the epoch begins [windows].

    Returns:
        The plan.
    """
    is_known = pictures.is_known[whose]
    links = links_between(radio, pictures.position_m[whose], pictures.spread_m[whose], is_known)
    num_windows = epoch_windows(len(timestamp))
    recipient, after = greedy_schedule(timestamp, now, links, num_windows, is_squared=True)
    return Plan(recipient=recipient, timestamp=after, is_complete=bool(np.all(is_known)))
