"""Errands among trees: robots fly to places, clear of trees and of the teammates they heard of.

    swarm-mj fly --robot quadrotor --collide --arena forest --height-m 5 --task random-walk
      --density-per-km2 1000 --controller training.examples.avoiding:Errands

A robot wants to fly to its place at full speed. Of all velocities it takes the nearest one that a
barrier for each tree and each teammate allows, and each of two that meet does half of it (Wang,
Ames and Egerstedt, IEEE Transactions on Robotics 33(3), 2017, here for velocities):

    v . n >= -(d - D) / (2 S),

where n points away from the teammate, d is the distance, D what is kept, and S a time; trees do
nothing, so robots do the whole of it. Trees are on the robots' map. Where a teammate is, they know
from its packets alone: it is taken to have flown on as it was when it observed that.

With `Delayed` the news is no radio's: all robots know all states of a while ago. `fresh`, without
a delay, shows what the barriers are worth if they are fed with the truth.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.physics.obstacles import obstacles_of
from swarm_mj.physics.scene import compose
from swarm_mj.physics.state import CYLINDER, RobotStates
from swarm_mj.protocol.buffers import Buffers
from swarm_mj.system.compiled import compiled

ARRIVED_M = 15.0  # more than a tree's radius and what is kept: a place may be in a tree
KEPT_M = 2.5  # D between the middles of two robots, and to a tree's bark
SOONEST_S = 1.5  # S: how fast distances may shrink; bodies need half a second to follow
GAIN_PER_S = 2.0  # of velocities; bodies' own is similar
ROUNDS = 20  # over all barriers, each of which a velocity is moved to


class Errands:
    """Each robot flies to one place after another, drawn evenly from the area."""

    cost_name, cost_unit = "speed lost", "m/s"

    def __init__(self, mission: Mission) -> None:
        obstacles = obstacles_of(compose(mission).compile())
        if np.any(obstacles.kind != CYLINDER):
            raise ValueError(
                f"arena {mission.arena} has obstacles that are no cylinders, which errands do not "
                "avoid; choose open or forest"
            )
        self._tree_m = np.ascontiguousarray(obstacles.centre_m[:, :2])
        self._tree_radius_m = obstacles.size_m[:, 0].copy()
        self._half_side_m = mission.half_side_m
        self._speed_mps = mission.max_velocity_mps
        self._window_s = mission.window_s

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draw the first places; arguments as in `Started.start`."""
        self._drawn = Stream(rngs, uniform, (num_robots, 2))
        self._place_m = self._places()

    def _places(self) -> Float[np.ndarray, "B N 2"]:
        return self._half_side_m * (2.0 * self._drawn.next() - 1.0)

    def _towards(self, states: RobotStates) -> Float[np.ndarray, "B N 2"]:
        """Return the direction of each robot's place, a vector of length 1."""
        apart_m = self._place_m - states.position_m[..., :2]
        far_m = np.maximum(np.linalg.norm(apart_m, axis=2, keepdims=True), 1e-9)
        return apart_m / far_m

    def news(
        self, buffers: Buffers, _states: RobotStates
    ) -> tuple[Bool[np.ndarray, "B N N"], Float[np.ndarray, "B N N 2"]]:
        """Return of whom each robot knows, and where it takes them to be now [m]."""
        age = np.einsum("bii->bi", buffers.timestamp)[:, :, None] - buffers.timestamp
        flown_m = (self._window_s * age)[..., None] * buffers.velocity_mps[..., :2]
        return buffers.is_known, buffers.position_m[..., :2] + flown_m

    def __call__(self, buffers: Buffers, states: RobotStates, /) -> Float[np.ndarray, "B N D"]:
        """Steer each robot to its place, by the velocity that the barriers allow [m/s²]."""
        apart_m = np.linalg.norm(self._place_m - states.position_m[..., :2], axis=2)
        self._place_m = np.where((apart_m < ARRIVED_M)[..., None], self._places(), self._place_m)
        is_known, team_m = self.news(buffers, states)
        wanted_mps = self._speed_mps * self._towards(states)
        _keep_clear(
            position_m=states.position_m,
            is_known=is_known,
            team_m=team_m,
            tree_m=self._tree_m,
            tree_radius_m=self._tree_radius_m,
            wanted_mps=wanted_mps,
        )
        acceleration_mps2 = np.zeros_like(states.velocity_mps)
        acceleration_mps2[..., :2] = GAIN_PER_S * (wanted_mps - states.velocity_mps[..., :2])
        return acceleration_mps2

    def cost(self, states: RobotStates, /) -> Float[np.ndarray, "B"]:
        """Return how much slower than V_max robots come nearer to their places, on average [m/s].

        Robots that crashed come no nearer.
        """
        nearer_mps = np.sum(states.velocity_mps[..., :2] * self._towards(states), axis=2)
        if states.has_crashed is not None:
            nearer_mps = np.where(states.has_crashed, 0.0, nearer_mps)
        return np.maximum(self._speed_mps - np.mean(nearer_mps, axis=1), 0.0)


class Delayed(Errands):
    """The same errands if all robots knew all states of a number of windows ago."""

    def __init__(self, delay: int, mission: Mission) -> None:
        super().__init__(mission)
        self._delay = delay

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Forget all states, and draw the first places."""
        super().start(num_robots, rngs)
        self._past: list[RobotStates] = []

    def news(
        self, buffers: Buffers, states: RobotStates
    ) -> tuple[Bool[np.ndarray, "B N N"], Float[np.ndarray, "B N N 2"]]:
        """Return that all are known, and where they are by their old states [m]."""
        self._past.append(states)
        delay = min(self._delay, len(self._past) - 1)
        then = self._past[-1 - delay]
        del self._past[: -1 - self._delay]
        flown_m = self._window_s * delay * then.velocity_mps[..., :2]
        team_m = then.position_m[..., :2] + flown_m
        shape = buffers.is_known.shape
        return np.ones(shape, dtype=np.bool_), np.broadcast_to(team_m[:, None], (*shape, 2)).copy()


# News of these ages, at the usual window of 100 ms.
fresh = partial(Delayed, 0)
half_a_second = partial(Delayed, 5)
one_second = partial(Delayed, 10)
two_seconds = partial(Delayed, 20)
three_seconds = partial(Delayed, 30)
four_seconds = partial(Delayed, 40)


@compiled(makes_arrays=False)
def _keep_clear(
    position_m: Float[np.ndarray, "B N D"],
    is_known: Bool[np.ndarray, "B N N"],
    team_m: Float[np.ndarray, "B N N 2"],
    tree_m: Float[np.ndarray, "O 2"],
    tree_radius_m: Float[np.ndarray, "O"],
    wanted_mps: Float[np.ndarray, "B N 2"],
) -> None:
    """Move velocities to the nearest that all barriers allow, barrier after barrier."""
    for b in range(is_known.shape[0]):
        for i in range(is_known.shape[1]):
            x = position_m[b, i, 0]
            y = position_m[b, i, 1]
            for _ in range(ROUNDS):
                moved = _pass_robots(i, x, y, is_known[b, i], team_m[b, i], wanted_mps[b, i])
                moved += _pass_trees(x, y, tree_m, tree_radius_m, wanted_mps[b, i])
                if not moved:
                    break


@compiled(makes_arrays=False)
def _pass_robots(
    i: int,
    x: float,
    y: float,
    is_known: Bool[np.ndarray, "N"],
    team_m: Float[np.ndarray, "N 2"],
    wanted_mps: Float[np.ndarray, "2"],
) -> int:
    """Move robot i's velocity to its half of each teammate's barrier; return to how many."""
    moved = 0
    for j in range(is_known.shape[0]):
        if j != i and is_known[j]:
            moved += _give_way(x - team_m[j, 0], y - team_m[j, 1], KEPT_M, 0.5, wanted_mps)
    return moved


@compiled(makes_arrays=False)
def _pass_trees(
    x: float,
    y: float,
    tree_m: Float[np.ndarray, "O 2"],
    tree_radius_m: Float[np.ndarray, "O"],
    wanted_mps: Float[np.ndarray, "2"],
) -> int:
    """Move a velocity to the barrier of each tree; return to how many."""
    moved = 0
    for o in range(tree_m.shape[0]):
        kept_m = KEPT_M + tree_radius_m[o]
        moved += _give_way(x - tree_m[o, 0], y - tree_m[o, 1], kept_m, 1.0, wanted_mps)
    return moved


@compiled(makes_arrays=False)
def _give_way(
    x: float, y: float, kept_m: float, share: float, wanted_mps: Float[np.ndarray, "2"]
) -> int:
    """Move a velocity to a barrier if it is beyond: return 1, or 0 if it is not."""
    far_m = max(np.sqrt(x * x + y * y), 1e-9)
    x /= far_m
    y /= far_m
    least_mps = -share * (far_m - kept_m) / SOONEST_S
    away_mps = x * wanted_mps[0] + y * wanted_mps[1]
    if away_mps >= least_mps - 1e-6:
        return 0
    wanted_mps[0] += x * (least_mps - away_mps)
    wanted_mps[1] += y * (least_mps - away_mps)
    return 1
