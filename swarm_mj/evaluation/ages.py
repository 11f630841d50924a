"""Ages of knowledge at the end of a window: how often each one was, and how low any radio gets."""

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission.geometry import gather_connected
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.system.compiled import compiled


@compiled()
def count_ages(
    timestamp: Float[np.ndarray, "B N N"],
    now: Float[np.ndarray, "B"],
    counts: Int[np.ndarray, "bins"],
    is_active: Bool[np.ndarray, "B N"],
) -> None:
    """Add to `counts`, by age in slots, how old what active robots know of each other is."""
    num_missions, num_robots = timestamp.shape[:2]
    for b in range(num_missions):
        for i in range(num_robots):
            if not is_active[b, i]:
                continue
            for j in range(num_robots):
                if is_active[b, j]:
                    counts[int((now[b] - timestamp[b, i, j]) / SLOT_WINDOWS)] += 1
            counts[int((now[b] - timestamp[b, i, i]) / SLOT_WINDOWS)] -= 1


@compiled()
def connectivity_floor(
    timestamp: Float[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N D"],
    range_m: float,
    now: Float[np.ndarray, "B"],
    is_on: Bool[np.ndarray, "B N"],
) -> Float[np.ndarray, "B"]:
    """Let connected robots share everything at once; return the mean age of all pairs as in II-C.

    Two robots are neighbours while a lone packet decodes between them, within `range_m`. At the end
    of a window, `now`, every robot receives the newest entries of its connected part of the disk
    graph, in T [windows] in place. The age that is left is due to teams that fall apart: the
    floor that no radio goes below, if robots rest while they talk. Only robots that are on share
    and count.
    """
    num_missions, num_robots = position_m.shape[:2]
    age = np.empty(num_missions)
    newest = np.empty(num_robots)
    is_met = np.empty(num_robots, dtype=np.bool_)
    part = np.empty(num_robots, dtype=np.int64)
    for b in range(num_missions):
        is_met[:] = ~is_on[b]  # robots that are off share nothing, so no part begins at them
        total = 0.0
        for first in range(num_robots):
            if is_met[first]:
                continue
            members = part[: gather_connected(position_m[b], range_m, first, is_met, part)]
            newest[:] = timestamp[b, first]
            for i in members:
                np.maximum(newest, timestamp[b, i], newest)  # in place: nothing is allocated
            for i in members:
                newest[i] = now[b]
            for i in members:
                timestamp[b, i] = newest
            total += members.size * newest[is_on[b]].sum()
        num_on = is_on[b].sum()
        age[b] = now[b] - total / (num_on * num_on)
    return age
