"""Whose turn it is nearby: a common order of identities and the clock, thinned by distance.

Robot `t mod N` leads in window t. After it the others join in the order of their identities, from
half a round away on, so that nobody's turns come close to each other; who is closer than a radius
to a robot that has joined does not (a maximal independent set). A robot of unknown position may be
near anyone: nobody joins after it. Robots that believe the same positions find the same sets,
without a word.
"""

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from swarm_mj.compiled import compiled
from swarm_mj.mission.geometry import squared_distance


@compiled()
def write_turns(
    believed_m: Float[np.ndarray, "B N N 2"],
    is_known: Bool[np.ndarray, "B N N"],
    now: Float[np.ndarray, "B"],
    radius_m: float,
    has_turn: Float32[np.ndarray, "B N N"],
) -> None:
    """Writes which of the robots that each robot knows have a turn.

    Args:
        believed_m: Where robot i believes the others to be [m].
        is_known: Whom it knows; itself, always.
        now: t [windows].
        radius_m: Least distance of robots that have a turn at once [m].
        has_turn: 1 where robot k has a turn by robot i's beliefs, else 0; overwritten.
    """
    num_missions, num_robots = is_known.shape[:2]
    taken = np.empty(num_robots, dtype=np.int64)
    has_turn[...] = 0.0
    for b in range(num_missions):
        for i in range(num_robots):
            num_taken = _join(believed_m[b, i], is_known[b, i], int(now[b]), radius_m**2, taken)
            for k in taken[:num_taken]:
                has_turn[b, i, k] = 1.0


@compiled()
def _join(
    believed_m: Float[np.ndarray, "N 2"],
    is_known: Bool[np.ndarray, "N"],
    now: int,
    least_m2: float,
    taken: Int[np.ndarray, "N"],
) -> int:
    """Fills `taken` with the robots that have a turn; returns how many they are."""
    num_robots = is_known.shape[0]
    num_taken = 0
    for place in range(num_robots + 1):
        k = now % num_robots if place == 0 else (now + num_robots // 2 + place - 1) % num_robots
        if not is_known[k]:
            break
        is_free = True
        for m in range(num_taken):
            if k == taken[m] or squared_distance(believed_m, k, taken[m]) < least_m2:
                is_free = False
                break
        if is_free:
            taken[num_taken] = k
            num_taken += 1
    return num_taken
