"""Robots that fail half-way through a mission: a test of robustness, not the paper's.

From then on they neither transmit nor decode, and observe nothing, while they stand or move as
before. No robot is told who has failed. Index order: `[b, i]` is robot `i` of mission `b`.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool

from swarm_mj.mission import Mission

MIN_SURVIVORS = 2  # whatever the fraction, so that there is an age of information


def num_failures(mission: Mission) -> int:
    """How many robots fail: to the nearest, at least 1, but at least 2 survive."""
    if mission.failure_fraction == 0.0:
        return 0
    nearest = max(1, round(mission.failure_fraction * mission.num_robots))
    return min(nearest, mission.num_robots - MIN_SURVIVORS)


def failure_window(mission: Mission) -> int:
    """Return the window at whose start they fail, counted from 0 [windows]."""
    return mission.num_windows // 2


def draw_survivors(
    mission: Mission, rngs: Sequence[np.random.Generator]
) -> Bool[np.ndarray, "B N"] | None:
    """Who is active in the second half of the missions.

    Args:
        mission: The numbers of every mission.
        rngs: One per mission.

    Returns:
        Whether each robot is, as many in every mission; None if nobody fails.
    """
    num_failed = num_failures(mission)
    if num_failed == 0:
        return None
    is_active = np.ones((len(rngs), mission.num_robots), dtype=np.bool_)
    for b, rng in enumerate(rngs):
        is_active[b, rng.choice(mission.num_robots, size=num_failed, replace=False)] = False
    return is_active
