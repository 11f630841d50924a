"""Whose turn it is nearby: a common order of identities and the clock, thinned by distance.

Robot `t mod N` leads in window t. After it the others join in the order of their identities, from
half a round away on, so that nobody's turns come close to each other; who is closer than a radius
to a robot that has joined does not (a maximal independent set). A robot of unknown position may be
near anyone: nobody joins after it. Robots that believe the same positions find the same sets,
without a word.
"""

import numpy as np
from jaxtyping import Bool, Float, Float32

from swarm_mj.radio.spatial_reuse import believes_as_the_last
from swarm_mj.system.compiled import compiled


@compiled()
def write_turns(
    believed_m: Float[np.ndarray, "B N N 2"],
    is_known: Bool[np.ndarray, "B N N"],
    now: Float[np.ndarray, "B"],
    radius_m: float,
    has_turn: Float32[np.ndarray, "B N N"],
) -> None:
    """Write which of the robots that each robot knows have a turn.

    Args:
        believed_m: Where robot i believes the others to be [m].
        is_known: Whom it knows; itself, always.
        now: t [windows].
        radius_m: Least distance of robots that have a turn at once [m].
        has_turn: 1 where robot k has a turn by robot i's beliefs, else 0; overwritten.
    """
    num_missions, num_robots = is_known.shape[:2]
    # Columns of their own, with which the inner loop is compiled to vectors.
    x_m, y_m, is_close = np.empty(num_robots), np.empty(num_robots), np.empty(num_robots)
    for b in range(num_missions):
        for i in range(num_robots):
            if believes_as_the_last(believed_m[b], is_known[b], i):
                for k in range(num_robots):
                    has_turn[b, i, k] = has_turn[b, i - 1, k]
                continue
            for k in range(num_robots):
                x_m[k], y_m[k] = believed_m[b, i, k, 0], believed_m[b, i, k, 1]
                has_turn[b, i, k] = is_close[k] = 0.0
            _join(x_m, y_m, is_known[b, i], int(now[b]), radius_m**2, is_close, has_turn[b, i])


@compiled()
def _join(
    x_m: Float[np.ndarray, "N"],
    y_m: Float[np.ndarray, "N"],
    is_known: Bool[np.ndarray, "N"],
    now: int,
    least_m2: float,
    is_close: Float[np.ndarray, "N"],
    has_turn: Float32[np.ndarray, "N"],
) -> None:
    """Mark the robots that have a turn, and all that are too close to one of them."""
    num_robots = is_known.shape[0]
    half_round = (now + num_robots // 2) % num_robots
    for place in range(num_robots + 1):
        k = now % num_robots if place == 0 else half_round + place - 1
        k -= num_robots if k >= num_robots else 0
        if not is_known[k]:
            break
        if is_close[k] == 0.0 and has_turn[k] == 0.0:
            has_turn[k] = 1.0
            for j in range(num_robots):
                dx, dy = x_m[j] - x_m[k], y_m[j] - y_m[k]
                is_close[j] = 1.0 if dx * dx + dy * dy < least_m2 else is_close[j]
