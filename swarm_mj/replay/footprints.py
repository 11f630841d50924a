"""Obstacles cut at the antennas' height: where they stand in the way, as outlines on the ground."""

import itertools

import numpy as np
from jaxtyping import Float
from scipy.spatial import ConvexHull

from swarm_mj.physics.obstacles import BOX, CAPSULE, CYLINDER, Obstacles

CORNERS = 24  # of a circle
RINGS = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 9)  # of a ball, by latitude


def footprints(obstacles: Obstacles, height_m: float) -> list[Float[np.ndarray, "K 2"]]:
    """The outline of each obstacle that reaches this height above the floor, once round [m]."""
    outlines = []
    for kind, centre_m, rotation, size_m in zip(*obstacles[:4], strict=True):
        points = _surface(int(kind), size_m) @ rotation.T + centre_m
        cut = _cut(points, height_m)
        if len(cut) > 2:
            corners = cut[ConvexHull(cut).vertices]
            outlines.append(np.concatenate([corners, corners[:1]]))
    return outlines


def filling(
    outline_m: Float[np.ndarray, "K 2"], apart_m: float
) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Lines from west to east that fill an outline, so far apart [m]."""
    y_low, y_high = np.min(outline_m[:, 1]), np.max(outline_m[:, 1])
    num = max(1, int(np.ceil((y_high - y_low) / apart_m)))
    lines = []
    for y in y_low + (np.arange(num) + 0.5) * (y_high - y_low) / num:
        xs = [
            a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
            for a, b in itertools.pairwise(outline_m.tolist())
            if min(a[1], b[1]) <= y < max(a[1], b[1])
        ]
        lines.append(((min(xs), y), (max(xs), y)))
    return lines


def _surface(kind: int, size_m: Float[np.ndarray, "3"]) -> Float[np.ndarray, "K 3"]:
    """Points whose convex hull is the obstacle, in its own frame [m]."""
    if kind == BOX:
        return size_m * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(CORNERS)], axis=1)
    if kind in (CYLINDER, CAPSULE):
        half = np.array([0.0, 0.0, size_m[1]])
        disc = size_m[0] * (circle if kind == CYLINDER else _ball(circle))
        return np.concatenate([disc - half, disc + half])
    return _ball(circle) * (size_m if np.all(size_m > 0.0) else size_m[0])


def _ball(circle: Float[np.ndarray, "C 3"]) -> Float[np.ndarray, "K 3"]:
    rings = [np.cos(turn) * circle + (0.0, 0.0, np.sin(turn)) for turn in RINGS]
    return np.concatenate(rings)


def _cut(points_m: Float[np.ndarray, "K 3"], height_m: float) -> Float[np.ndarray, "C 2"]:
    """Where lines from the points above this height to those below pass it."""
    is_above = points_m[:, 2] > height_m
    above, below = points_m[is_above][:, None], points_m[~is_above][None]
    share = (above[..., 2:] - height_m) / (above[..., 2:] - below[..., 2:])
    return (above + share * (below - above))[..., :2].reshape(-1, 2)
