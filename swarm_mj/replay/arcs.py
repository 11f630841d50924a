"""Packets as arcs over the ground."""

import numpy as np
from jaxtyping import Float

SEGMENTS = 6  # straight pieces of an arc
RISE = 0.22  # of an arc's top, by its span


def arcs(
    start_m: Float[np.ndarray, "L 2"], end_m: Float[np.ndarray, "L 2"], base_m: float = 0.0
) -> Float[np.ndarray, "L P 3"]:
    """Points along parabolas that start and end at `base_m` above the ground [m]."""
    share = np.linspace(0.0, 1.0, SEGMENTS + 1)
    span_m = np.linalg.norm(end_m - start_m, axis=1)
    height_m = base_m + 4.0 * RISE * span_m[:, None] * share * (1.0 - share)
    ground_m = start_m[:, None] + share[:, None] * (end_m - start_m)[:, None]
    return np.concatenate([ground_m, height_m[..., None]], axis=2)
