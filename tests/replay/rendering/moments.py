"""Moments to draw."""

import numpy as np

from swarm_mj.replay.footage import Contents

GREEN = (0, 205, 145)


def moment(position_m, links=(), *, observer=0, reach_m=500.0):
    """Green robots at rest, the observer white, and green links between robots."""
    where = np.array(position_m, dtype=float)
    colour = np.tile(np.array(GREEN, dtype=np.uint8), (len(where), 1))
    colour[observer] = 255
    start, end = (np.array([pair[k] for pair in links], dtype=int) for k in (0, 1))
    return Contents(
        position_m=where,
        velocity_mps=np.zeros_like(where),
        colour=colour,
        observer=observer,
        start_m=where[start],
        end_m=where[end],
        packet_colour=np.tile(np.array(GREEN, dtype=np.uint8), (len(start), 1)),
        lines_m=np.zeros((0, 2, 2)),
        line_colour=np.zeros((0, 3), dtype=np.uint8),
        is_cut_off=np.zeros(len(where), dtype=bool),
        centre_m=np.zeros(2),
        reach_m=reach_m,
    )
