"""What robots might have seen, and lessons of it."""

import numpy as np

from swarm_mj.learning.residual.recording import Lesson
from swarm_mj.policies.residual.features import NEIGHBOUR_FEATURES, ROBOT_FEATURES, Seen


def seen_at_random(seed, num_rows):
    """By robots of which each has no neighbour, one, or two."""
    rng = np.random.default_rng(seed)
    owner = np.repeat(np.arange(num_rows), np.arange(num_rows) % 3)
    robots, neighbours = (
        rng.normal(0.0, 0.5, (rows, len(names))).astype(np.float32)
        for rows, names in ((num_rows, ROBOT_FEATURES), (len(owner), NEIGHBOUR_FEATURES))
    )
    return Seen(robots, neighbours, owner)


def lesson_of(seen, worth, logit=0.0, weight=1.0):
    """Of decisions that were worth so much."""
    shape = (len(seen.robots),)
    logit, weight, worth = (
        np.broadcast_to(np.float32(each), shape).copy() for each in (logit, weight, worth)
    )
    return Lesson(seen, logit, weight, worth)
