"""Endless walls through the middle of the area, and what they leave of the power."""

import numpy as np

from swarm_mj.physics.state import BOX, Obstacles


def walls(power_left, *axes):
    """Each is thin along its axis: 0 stands between x < 0 and x > 0, 1 between y < 0 and y > 0."""
    size_m = np.full((len(axes), 3), 1e4)
    size_m[np.arange(len(axes)), list(axes)] = 1.0
    return Obstacles(
        kind=np.full(len(axes), BOX),
        centre_m=np.zeros((len(axes), 3)),
        rotation=np.tile(np.eye(3), (len(axes), 1, 1)),
        size_m=size_m,
        reach_m=np.full(len(axes), 2e4),
        power_left=np.full(len(axes), power_left),
    )
