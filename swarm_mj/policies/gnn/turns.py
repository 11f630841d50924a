"""Turns that follow from one robot's beliefs, in a common order thinned by distance."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32

from swarm_mj.system.compiled import compiled


class Beliefs(NamedTuple):
    """Where one robot believes the others to be, in columns: loops over them become vectors."""

    is_known: Bool[np.ndarray, "N"]
    x_m: Float[np.ndarray, "N"]  # infinitely far off if it is unknown
    y_m: Float[np.ndarray, "N"]
    num_near: Float[np.ndarray, "N"]  # room for `count_near`
    is_close: Float[np.ndarray, "N"]  # room for `write_turns`


@compiled()
def empty_beliefs(num_robots: int) -> Beliefs:
    """Return room for the beliefs of one robot, and then of the next one."""
    return Beliefs(
        is_known=np.empty(num_robots, dtype=np.bool_),
        x_m=np.empty(num_robots),
        y_m=np.empty(num_robots),
        num_near=np.empty(num_robots),
        is_close=np.empty(num_robots),
    )


@compiled(makes_arrays=False)
def take_beliefs(
    believed_m: Float[np.ndarray, "N D"], is_known: Bool[np.ndarray, "N"], beliefs: Beliefs
) -> bool:
    """Take the beliefs of one robot; return whether they differ from those taken before."""
    num_different = 0  # counted, as the loop then has no branches
    for k in range(len(is_known)):
        x_m = believed_m[k, 0] if is_known[k] else np.inf
        y_m = believed_m[k, 1]
        num_different += (x_m != beliefs.x_m[k]) | (y_m != beliefs.y_m[k])
        beliefs.is_known[k] = is_known[k]
        beliefs.x_m[k] = x_m
        beliefs.y_m[k] = y_m
    return num_different > 0


@compiled(makes_arrays=False)
def count_near(beliefs: Beliefs, radius_m: float) -> None:
    """Count for each known robot who is within a radius of it, itself included; else 0."""
    x_m, y_m, num_near = beliefs.x_m, beliefs.y_m, beliefs.num_near
    num_near[:] = 0.0
    for k in range(len(x_m)):
        # Added up robot by robot, as numbers of one kind: a count in whole numbers takes longer.
        for j in range(len(x_m)):
            dx = x_m[j] - x_m[k]
            dy = y_m[j] - y_m[k]
            num_near[j] += 1.0 if dx * dx + dy * dy <= radius_m * radius_m else 0.0


@compiled(makes_arrays=False)
def write_turns(
    beliefs: Beliefs, window: int, radius_m: float, has_turn: Float32[np.ndarray, "N"]
) -> None:
    """Write 1 for the robots that have a turn by one robot's beliefs, 0 for the others.

    A common order of identities and the clock, thinned by distance: robot `t mod N` leads in window
    t. After it the others join in the order of their identities, unless they are closer than the
    radius to a robot that has joined (a maximal independent set); from half a round away on, so
    that no robot's turns come close to each other. A robot of unknown position may be near anyone,
    so nobody joins after it.
    """
    x_m, y_m, is_close = beliefs.x_m, beliefs.y_m, beliefs.is_close
    num_robots = len(x_m)
    has_turn[:] = 0.0
    is_close[:] = 0.0
    k = window % num_robots
    next_k = (window + num_robots // 2) % num_robots
    for _ in range(num_robots + 1):
        if not beliefs.is_known[k]:
            break
        if is_close[k] == 0.0 and has_turn[k] == 0.0:
            has_turn[k] = 1.0
            for j in range(num_robots):
                dx = x_m[j] - x_m[k]
                dy = y_m[j] - y_m[k]
                # Written each time: a choice whether to write would keep the loop from vectors.
                is_close[j] = 1.0 if dx * dx + dy * dy < radius_m * radius_m else is_close[j]
        k = next_k
        next_k = next_k + 1 if next_k + 1 < num_robots else 0
