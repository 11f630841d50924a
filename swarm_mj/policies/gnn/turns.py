"""Turns that follow from one robot's beliefs, in a common order thinned by distance."""

import numpy as np
from jaxtyping import Bool, Float, Float32

from swarm_mj.system.compiled import compiled

Column = Float[np.ndarray, "N"]


@compiled()
def count_near(x_m: Column, y_m: Column, from_x_m: float, from_y_m: float, radius_m: float) -> int:
    """Return how many of some places are within a radius of one."""
    num_near = 0
    for n in range(len(x_m)):
        dx = x_m[n] - from_x_m
        dy = y_m[n] - from_y_m
        num_near += dx * dx + dy * dy <= radius_m * radius_m
    return num_near


@compiled()
def write_turns(
    x_m: Column,
    y_m: Column,
    is_known: Bool[np.ndarray, "N"],
    window: int,
    radius_m: float,
    has_turn: Float32[np.ndarray, "N"],
    is_close: Column,
) -> None:
    """Write 1 for the robots that have a turn by one robot's beliefs, 0 for the others.

    A common order of identities and the clock, thinned by distance: robot `t mod N` leads in window
    t. After it the others join in the order of their identities, unless they are closer than the
    radius to a robot that has joined (a maximal independent set); from half a round away on, so
    that no robot's turns come close to each other. A robot of unknown position may be near anyone,
    so nobody joins after it. `is_close` is overwritten: room to mark who is too close.
    """
    num_robots = is_known.shape[0]
    has_turn[:] = 0.0
    is_close[:] = 0.0
    half_round = (window + num_robots // 2) % num_robots
    for place in range(num_robots + 1):
        k = window % num_robots if place == 0 else (half_round + place - 1) % num_robots
        if not is_known[k]:
            break
        if is_close[k] == 0.0 and has_turn[k] == 0.0:
            has_turn[k] = 1.0
            for j in range(num_robots):
                dx = x_m[j] - x_m[k]
                dy = y_m[j] - y_m[k]
                # Written each time: a choice whether to write would keep the loop from vectors.
                is_close[j] = 1.0 if dx * dx + dy * dy < radius_m * radius_m else is_close[j]
