"""A team that follows its leader through a city, by what it has heard of the leader.

    swarm-mj fly --controller training.examples.city_tour:Tour --task random-walk --arena blocks

Robot r0 goes round the blocks. The others know the map, but the leader's place from packets only:
each walks along the streets towards the spot where the leader is by its buffer, and keeps its
distance from the teammates that it has heard of. The cost is the mean distance from the leader.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import shortest_path

from swarm_mj.mission import Mission
from swarm_mj.physics.obstacles import obstacles_of
from swarm_mj.physics.scene import compose
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import Buffers

CELL_M = 12.0  # side of the squares of the street map
CLEARANCE_M = 12.0  # from a wall to the nearest square that robots enter
AHEAD = 3  # squares on the way that a robot aims at
APART_M = 40.0  # distance that robots keep from each other
LEADER_SHARE = 0.7  # of the top speed, so that the others can catch up
TURNS = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))  # of the tour, in half sides
ARRIVED_M = 30.0


class StreetMap:
    """Squares that robots can enter, and the shortest ways between them."""

    def __init__(self, mission: Mission) -> None:
        """Find the squares that are clear of obstacles, and all ways along them."""
        self._half_m = mission.half_side_m
        self._num = max(2, round(mission.side_m / CELL_M))
        self._cell_m = mission.side_m / self._num
        line_m = (np.arange(self._num) + 0.5) * self._cell_m - self._half_m
        self.centre_m = np.stack(np.meshgrid(line_m, line_m, indexing="ij"), axis=-1).reshape(-1, 2)
        is_free = self._free(mission)
        ways = self._ways(is_free)
        self._next = shortest_path(ways, return_predecessors=True)[1]
        # A robot in a square that is not free, beside a wall, is taken to be in the nearest one.
        apart_m = np.linalg.norm(self.centre_m[:, None] - self.centre_m[is_free], axis=2)
        self._nearest = np.flatnonzero(is_free)[np.argmin(apart_m, axis=1)]

    def _free(self, mission: Mission) -> Bool[np.ndarray, "C"]:
        found = obstacles_of(compose(mission).compile())
        is_free = np.ones(len(self.centre_m), dtype=bool)
        for centre_m, size_m in zip(found.centre_m, found.size_m, strict=True):
            off_m = np.abs(self.centre_m - centre_m[:2]) - size_m[:2]
            is_free &= np.max(off_m, axis=1) > CLEARANCE_M
        return is_free

    def _ways(self, is_free: Bool[np.ndarray, "C"]) -> coo_array:
        number = np.arange(len(is_free)).reshape(self._num, self._num)
        pairs = [
            (number[:-1], number[1:]),
            (number[:, :-1], number[:, 1:]),
            (number[:-1, :-1], number[1:, 1:]),
            (number[:-1, 1:], number[1:, :-1]),
        ]
        starts = np.concatenate([a.ravel() for a, _ in pairs])
        ends = np.concatenate([b.ravel() for _, b in pairs])
        is_way = is_free[starts] & is_free[ends]
        starts, ends = starts[is_way], ends[is_way]
        length_m = np.linalg.norm(self.centre_m[starts] - self.centre_m[ends], axis=1)
        size = (len(is_free), len(is_free))
        one_way = coo_array((length_m, (starts, ends)), shape=size)
        return (one_way + one_way.T).tocsr()

    def square(self, position_m: Float[np.ndarray, "*S 2"]) -> Int[np.ndarray, "*S"]:
        """Return the free square nearest to the one of each position [m]."""
        place = np.floor((position_m + self._half_m) / self._cell_m).astype(int)
        x, y = np.moveaxis(np.clip(place, 0, self._num - 1), -1, 0)
        return self._nearest[x * self._num + y]

    def towards(
        self, position_m: Float[np.ndarray, "*S 2"], goal_m: Float[np.ndarray, "*S 2"]
    ) -> Float[np.ndarray, "*S 2"]:
        """Return a point on the way to the goal; the goal itself where it is near [m]."""
        at = self.square(position_m)
        goal = self.square(goal_m)
        for _ in range(AHEAD):
            # From the goal back: the square before `at` on the way that ends there.
            step = self._next[goal, at]
            at = np.where(step >= 0, step, at)
        return np.where((at == goal)[..., None], goal_m, self.centre_m[at])


class Tour:
    """The leader goes round; the others go where they believe it is."""

    cost_name = "mean distance from r0"
    cost_unit = "m"

    def __init__(self, mission: Mission) -> None:
        """Draw the street map of the mission's arena."""
        self._map = StreetMap(mission)
        self._top_mps = mission.max_velocity_mps
        turns_m = mission.half_side_m * np.array(TURNS)
        self._turns_m = self._map.centre_m[self._map.square(turns_m)]

    def start(self, _num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Send each mission's leader to the first turn."""
        self._turn = np.zeros(len(rngs), dtype=int)

    def __call__(self, buffers: Buffers, states: RobotStates) -> Float[np.ndarray, "B N 2"]:
        """Return the accelerations towards the velocities wanted [m/s²]."""
        goal_m = buffers.position_m[:, :, 0].copy()
        goal_m[:, 0] = self._leaders_goal_m(states.position_m[:, 0])
        aim_m = self._map.towards(states.position_m, goal_m) - states.position_m
        distance_m = np.linalg.norm(aim_m, axis=2, keepdims=True)
        wanted_mps = self._top_mps * aim_m / np.maximum(distance_m, CELL_M)
        wanted_mps[:, 0] *= LEADER_SHARE
        is_lost = ~buffers.is_known[:, :, 0]
        is_lost[:, 0] = False
        wanted_mps[is_lost] = 0.0
        wanted_mps[:, 1:] += self._keep_apart_mps(buffers, states)[:, 1:]
        return 2.0 * (wanted_mps - states.velocity_mps)

    def cost(self, states: RobotStates) -> Float[np.ndarray, "B"]:
        """Return the mean distance from the leader [m]."""
        apart_m = states.position_m[:, 1:] - states.position_m[:, :1]
        return np.linalg.norm(apart_m, axis=2).mean(axis=1)

    def _leaders_goal_m(self, leader_m: Float[np.ndarray, "B 2"]) -> Float[np.ndarray, "B 2"]:
        """Return where each leader goes; one that has arrived goes on to the next turn."""
        goal_m = self._turns_m[self._turn]
        self._turn = (self._turn + (np.linalg.norm(goal_m - leader_m, axis=1) < ARRIVED_M)) % len(
            TURNS
        )
        return self._turns_m[self._turn]

    def _keep_apart_mps(self, buffers: Buffers, states: RobotStates) -> Float[np.ndarray, "B N 2"]:
        """Return velocities away from teammates that are believed near."""
        off_m = states.position_m[:, :, None] - buffers.position_m  # [b, i, j]: from j to i
        distance_m = np.linalg.norm(off_m, axis=3, keepdims=True)
        is_near = (distance_m < APART_M) & (distance_m > 0.0) & buffers.is_known[..., None]
        push = np.where(is_near, off_m / np.maximum(distance_m, 1.0), 0.0)
        push *= 1.0 - np.minimum(distance_m, APART_M) / APART_M
        return self._top_mps * push.sum(axis=2)
