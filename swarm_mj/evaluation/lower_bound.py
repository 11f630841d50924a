"""The connectivity floor: the age that no radio goes below, if robots rest while they talk."""

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission.geometry import gather_connected
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.system.compiled import compiled


class ConnectivityFloor:
    """The age of information if connected robots shared everything at once, in every mission.

    Two robots are neighbours while a lone packet decodes between them. In each window every robot
    receives the newest entries of its connected part of the disk graph. The age that is left is
    due to teams that fall apart.
    """

    def __init__(self, num_missions: int, num_robots: int, range_m: float) -> None:
        """Start before the first window, with empty buffers; neighbours are within `range_m`."""
        self._timestamp = np.full((num_missions, num_robots, num_robots), NEVER)
        self._range_m = range_m

    def next(
        self,
        position_m: Float[np.ndarray, "B N 2"],
        now: Float[np.ndarray, "B"],
        is_on: Bool[np.ndarray, "B N"],
    ) -> Float[np.ndarray, "B"]:
        """Share within connected parts, and return the mean age of all pairs as in II-C.

        Robots that are on share and count; `position_m` and `now` are of the end of the window.
        """
        age = np.empty(now.shape)
        _share(self._timestamp, position_m, self._range_m, now, is_on, age)
        return age


@compiled()
def _share(
    timestamp: Float[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N 2"],
    range_m: float,
    now: Float[np.ndarray, "B"],
    is_on: Bool[np.ndarray, "B N"],
    age: Float[np.ndarray, "B"],
) -> None:
    num_missions, num_robots = position_m.shape[:2]
    is_met = np.empty(num_robots, dtype=np.bool_)
    part = np.empty(num_robots, dtype=np.int64)
    newest = np.empty(num_robots)
    for b in range(num_missions):
        is_met[:] = ~is_on[b]  # robots that are off share nothing, so no part begins at them
        total = 0.0
        for i in range(num_robots):
            if not is_met[i]:
                num_members = gather_connected(position_m[b], range_m, i, is_met, part)
                _pool(timestamp[b], part[:num_members], now[b], newest)
                total += num_members * newest[is_on[b]].sum()
        num_on = is_on[b].sum()
        age[b] = now[b] - total / (num_on * num_on)


@compiled()
def _pool(
    timestamp: Float[np.ndarray, "N N"],
    members: Int[np.ndarray, "M"],
    now: float,
    newest: Float[np.ndarray, "N"],
) -> None:
    """Give every member the newest entry that any of them has, and `now` for the members."""
    newest[:] = timestamp[members[0]]
    for i in members[1:]:
        for j in range(newest.shape[0]):
            newest[j] = max(newest[j], timestamp[i, j])
    for i in members:
        newest[i] = now
    for i in members:
        timestamp[i] = newest
