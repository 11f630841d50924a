"""Robots that are switched off half-way through a mission: a test of robustness, not the paper's.

From then on they neither transmit nor decode, and observe nothing, while they stand or move as
before. Nobody is told who is off. Index order: `[b, i]` is robot `i` of mission `b`.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool

from swarm_mj.mission import Mission

MIN_ON = 2  # robots stay on whatever the fraction, so that there is an age of information


def num_switched_off(mission: Mission) -> int:
    """How many robots are switched off: to the nearest, at least 1, but at least 2 stay on."""
    if mission.switched_off == 0.0:
        return 0
    nearest = max(1, round(mission.switched_off * mission.num_robots))
    return min(nearest, mission.num_robots - MIN_ON)


def first_window_without(mission: Mission) -> int:
    """The window from whose start on they are off, counted from 0 [windows]."""
    return mission.num_windows // 2


def draw_is_on(
    mission: Mission, rngs: Sequence[np.random.Generator]
) -> Bool[np.ndarray, "B N"] | None:
    """Who is on in the second half of the missions.

    Args:
        mission: The numbers of every mission.
        rngs: One per mission.

    Returns:
        Whether each robot is on, as many in every mission; None if nobody is switched off.
    """
    num_off = num_switched_off(mission)
    if num_off == 0:
        return None
    is_on = np.ones((len(rngs), mission.num_robots), dtype=np.bool_)
    for b, rng in enumerate(rngs):
        is_on[b, rng.choice(mission.num_robots, size=num_off, replace=False)] = False
    return is_on
