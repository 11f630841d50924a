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


def write_turns(
    believed_m: Float[np.ndarray, "B N N 2"],
    is_known: Bool[np.ndarray, "B N N"],
    now: Float[np.ndarray, "B"],
    radius_m: Float[np.ndarray, "radii"],
    has_turn: Float32[np.ndarray, "B N N radii"],
) -> None:
    """Writes which of the robots that each robot knows have a turn, for every radius.

    Args:
        believed_m: Where robot i believes the others to be [m].
        is_known: Whom it knows; itself, always.
        now: t [windows].
        radius_m: Least distances of robots that have a turn at once [m].
        has_turn: 1 where robot k has a turn at a radius, by robot i's beliefs, else 0;
            overwritten.
    """
    taken = np.empty(believed_m.shape[1], dtype=np.int64)
    _write(believed_m, is_known, now, radius_m, taken, has_turn)


@compiled()
def _write(
    believed_m: Float[np.ndarray, "B N N 2"],
    is_known: Bool[np.ndarray, "B N N"],
    now: Float[np.ndarray, "B"],
    radius_m: Float[np.ndarray, "radii"],
    taken: Int[np.ndarray, "N"],
    has_turn: Float32[np.ndarray, "B N N radii"],
) -> None:
    num_missions, num_robots = is_known.shape[:2]
    has_turn[...] = 0.0
    for b in range(num_missions):
        for i in range(num_robots):
            for n in range(radius_m.shape[0]):
                num_taken = _join(
                    believed_m[b, i], is_known[b, i], int(now[b]), radius_m[n] ** 2, taken
                )
                for m in range(num_taken):
                    has_turn[b, i, taken[m], n] = 1.0


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
