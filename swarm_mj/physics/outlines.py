"""The outlines of obstacles where a map cuts them."""

import itertools

import numpy as np
from jaxtyping import Float

from swarm_mj.physics.state import BOX, CAPSULE, CYLINDER, Obstacles

CORNERS = 24  # of a circle
LATITUDES = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 9)  # of a ball's circles


def footprints(obstacles: Obstacles, height_m: float) -> list[Float[np.ndarray, "K 2"]]:
    """Return the outline of each obstacle that reaches this height, once round [m]."""
    from scipy.spatial import ConvexHull  # not of the core

    outlines = []
    for n, kind in enumerate(obstacles.kind):
        rotation = obstacles.rotation[n]
        centre_m = obstacles.centre_m[n]
        points_m = _surface(int(kind), obstacles.size_m[n]) @ rotation.T + centre_m
        # The outline is the hull of where lines from the points above to those below pass.
        _, _, z_m = points_m.T
        is_above = z_m > height_m
        above = points_m[is_above][:, None]
        below = points_m[~is_above][None]
        share = (above[..., 2:] - height_m) / (above[..., 2:] - below[..., 2:])
        cut = (above + share * (below - above))[..., :2].reshape(-1, 2)
        if len(cut) > 2:
            corners = cut[ConvexHull(cut).vertices]
            outlines.append(np.concatenate([corners, corners[:1]]))
    return outlines


def _surface(kind: int, size_m: Float[np.ndarray, "3"]) -> Float[np.ndarray, "K 3"]:
    """Return points whose convex hull is the obstacle, in its own frame [m]."""
    if kind == BOX:
        return size_m * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(CORNERS)], axis=1)
    ball = np.concatenate([np.cos(at) * circle + (0.0, 0.0, np.sin(at)) for at in LATITUDES])
    if kind in (CYLINDER, CAPSULE):
        half = np.array([0.0, 0.0, size_m[1]])
        disc = size_m[0] * (circle if kind == CYLINDER else ball)
        return np.concatenate([disc - half, disc + half])
    return ball * (size_m if np.all(size_m > 0.0) else size_m[0])
