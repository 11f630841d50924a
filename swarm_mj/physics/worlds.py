"""The robots' dynamics (IV-A): B worlds stepped side by side by MuJoCo, one window a call.

`Worlds` is what a mission asks of them. Those of points are here, those of robots with bodies in
`physics.bodies`.

Positions of points come from MuJoCo's step; only the mirror at a wall writes them. Two modes:

- `exact`: the paper's equation to rounding error. It moves p with the velocity before the kick,
  MuJoCo's Euler method with the velocity after it. So the servo's set point *is* v_t: one step of a
  window's length makes the velocity v_t and adds v_t dt to p; then v_{t+1} becomes the new set
  point.
- `contact`: forces at 10 ms steps, and joint limits that turn the velocity round at a wall.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float
from mujoco import batch
from mujoco._structs import MjModel  # private: type checkers see it only there

from swarm_mj.mission import Mission
from swarm_mj.mission.geometry import PLANE
from swarm_mj.physics.obstacles import Obstacles, obstacles_of
from swarm_mj.physics.scene import (
    ROBOT_MASS_KG,
    Scene,
    compiled_scene,
    compose,
    num_substeps,
    timestep_s,
)
from swarm_mj.physics.state import ROBOT_RADIUS_M, RobotStates
from swarm_mj.system.compiled import compiled


@runtime_checkable
class Worlds(Protocol):
    """B MuJoCo worlds of N robots, be they points or bodies.

    Attributes:
        states: Where the robots are [m], [B N D], how fast [m/s], and who is active, in arrays that
            later steps do not change.
        obstacles: What stands in the scene; None: nothing.
        reach_m: How far from its middle a robot collides, [N].
    """

    states: RobotStates
    obstacles: Obstacles | None
    reach_m: Float[np.ndarray, "N"]

    @property
    def pose(self) -> tuple[Float[np.ndarray, "B Q"], Float[np.ndarray, "B V"]]:
        """MuJoCo's coordinates of all worlds, and their rates, as they are now."""
        ...

    def start(
        self,
        rngs: Sequence[np.random.Generator],
        pilot_rngs: Sequence[np.random.Generator],
    ) -> None:
        """Draw what is each mission's own, from its generator; pilots draw from theirs."""
        ...

    def draw_heights_m(self, rng: np.random.Generator) -> Float[np.ndarray, "N"] | None:
        """Return how high the robots of a mission begin; None: they have no height."""
        ...

    def place(
        self, position_m: Float[np.ndarray, "B N D"], velocity_mps: Float[np.ndarray, "B N D"]
    ) -> None:
        """Restart all worlds from p_0 [m] and v_0 [m/s]; robots that collide must be apart."""
        ...

    def deactivate(self, is_active: Bool[np.ndarray, "B N"]) -> None:
        """Make these the active robots from now on."""
        ...

    def step(self, acceleration_mps2: Float[np.ndarray, "B N D"]) -> RobotStates:
        """Move all robots one window on; ValueError for a u of another shape, or not finite."""
        ...


class PointWorlds:
    """The `Worlds` of points."""

    def __init__(
        self,
        mission: Mission,
        num_missions: int,
        *,
        scene: Scene | None = None,
        num_threads: int = 1,
    ) -> None:
        """Compile the scene and make B worlds.

        Args:
            mission: Of all worlds.
            num_missions: B.
            scene: A user's, which adds to the arena.
            num_threads: Of MuJoCo's own.

        Raises:
            ValueError: The scene changes how robots move, or does not compile.
        """
        self._mission = mission
        self._model = compiled_scene(compose(mission, scene=scene), scene)
        if scene is not None:
            _check_free(self._model)
        found = obstacles_of(self._model)
        self.obstacles = found if len(found.kind) > 0 else None
        self._batch = batch.Batch(self._model, num_missions, num_threads)
        shape = (num_missions, mission.num_robots, PLANE)
        self._qpos = self._batch.bind("qpos").reshape(shape)
        self._qvel = self._batch.bind("qvel").reshape(shape)
        self._ctrl = self._batch.bind("ctrl").reshape(shape)
        self._wall_m = mission.half_side_m if mission.has_walls else np.inf
        self._rests = scene is None  # no scene can push robots at rest
        self.reach_m = np.full(mission.num_robots, ROBOT_RADIUS_M)  # of hulls
        # True states, in arrays that later steps do not change.
        self.states = RobotStates(position_m=np.zeros(shape), velocity_mps=np.zeros(shape))

    def start(
        self,
        rngs: Sequence[np.random.Generator],
        pilot_rngs: Sequence[np.random.Generator],
    ) -> None:
        """Draw nothing: points are all alike, and have no pilots."""

    def draw_heights_m(self, rng: np.random.Generator) -> None:
        """Return no heights, which points do not have."""

    def place(
        self, position_m: Float[np.ndarray, "B N D"], velocity_mps: Float[np.ndarray, "B N D"]
    ) -> None:
        """Restart all worlds from p_0 [m] and v_0 [m/s]; robots that collide must be apart."""
        self._batch.reset()
        self._qpos[...] = position_m
        self._qvel[...] = velocity_mps
        self._ctrl[...] = velocity_mps if self._mission.physics == "exact" else 0.0
        self.states = RobotStates(position_m=position_m.copy(), velocity_mps=velocity_mps.copy())

    @property
    def pose(self) -> tuple[Float[np.ndarray, "B Q"], Float[np.ndarray, "B V"]]:
        """MuJoCo's coordinates of all worlds, which are p, and their rates, which are v."""
        num_missions = len(self.states.position_m)
        position_m = self.states.position_m.reshape(num_missions, -1)
        return position_m, self.states.velocity_mps.reshape(num_missions, -1)

    def deactivate(self, is_active: Bool[np.ndarray, "B N"]) -> None:
        """Make these the active robots from now on; the others keep moving."""
        self.states = replace(self.states, is_active=is_active)

    def step(self, acceleration_mps2: Float[np.ndarray, "B N D"]) -> RobotStates:
        """Move all robots one window on: p + v Δt, then v + u Δt (Eq. 15).

        Each axis of u is clipped to A_max, and of v to V_max.

        Raises:
            ValueError: The accelerations u are not one finite vector [m/s²] for each robot.
        """
        check_accelerations(acceleration_mps2, self.states.position_m.shape)
        if self._mission.physics == "exact":
            self._step_exact(acceleration_mps2)
        else:
            self._step_contact(acceleration_mps2)
        return self.states

    def _step_exact(self, acceleration_mps2: Float[np.ndarray, "B N D"]) -> None:
        self._batch.step()
        shape = acceleration_mps2.shape
        is_active = self.states.is_active
        states = self.states = RobotStates(  # `replace` would take 3 µs
            position_m=np.empty(shape), velocity_mps=np.empty(shape), is_active=is_active
        )
        mission = self._mission
        _kick(
            qpos=self._qpos,
            qvel=self._qvel,
            ctrl=self._ctrl,
            acceleration=acceleration_mps2,
            dt_s=mission.window_s,
            limit_mps2=mission.max_acceleration_mps2,
            limit_mps=mission.max_velocity_mps,
            wall_m=self._wall_m,
            clips=mission.wall_hit == "clip",
            position=states.position_m,
            velocity=states.velocity_mps,
        )

    def _step_contact(self, acceleration_mps2: Float[np.ndarray, "B N D"]) -> None:
        if self._rests and not np.any(self._qvel) and not np.any(acceleration_mps2):
            return
        limit_mps = self._mission.max_velocity_mps
        limit_mps2 = self._mission.max_acceleration_mps2
        window_s = self._mission.window_s
        step_s = timestep_s(self._mission)
        # One constant acceleration per window, which ends at the paper's clipped velocity ...
        target_mps = self._qvel + np.clip(acceleration_mps2, -limit_mps2, limit_mps2) * window_s
        held_mps2 = (np.clip(target_mps, -limit_mps, limit_mps) - self._qvel) / window_s
        for _ in range(num_substeps(self._mission)):
            # ... and after a bounce never pushes beyond the bound, from either side.
            lowest = (-limit_mps - self._qvel) / step_s
            highest = (limit_mps - self._qvel) / step_s
            self._ctrl[...] = ROBOT_MASS_KG * np.clip(held_mps2, lowest, highest)
            self._batch.step()
        np.clip(self._qvel, -limit_mps, limit_mps, out=self._qvel)  # rounding of the last step
        self.states = replace(
            self.states, position_m=self._qpos.copy(), velocity_mps=self._qvel.copy()
        )


def check_accelerations(given: np.ndarray, expected: tuple[int, ...]) -> None:
    """Raise ValueError unless the controller gave one finite vector per robot."""
    if given.shape != expected:
        shape = f"{expected}, missions by robots by axes"
        raise ValueError(f"acceleration must have shape {shape}, not {given.shape}")
    if not _are_finite(given):
        b, i, _ = np.argwhere(~np.isfinite(given))[0]
        vector = ", ".join(f"{number:g}" for number in given[b, i])
        raise ValueError(f"acceleration must be finite, not ({vector}) of robot {i} in mission {b}")


def _check_free(model: MjModel) -> None:
    """Raise ValueError if a scene made robots heavier or lighter, or tied them to anything."""
    is_tied = model.neq + model.ntendon > 0
    if is_tied or not np.allclose(model.dof_M0, ROBOT_MASS_KG):
        raise ValueError(
            "a scene must leave how robots move, but changed their mass or tied them; give geoms "
            "on robots mass=0, and add neither equalities nor tendons"
        )


@compiled()
def _are_finite(numbers: Float[np.ndarray, "B N D"]) -> bool:
    for number in numbers.flat:  # noqa: SIM110 - no generators in loops that numba compiles
        if not np.isfinite(number):
            return False
    return True


@compiled(makes_arrays=False)
def next_velocity(v: float, u: float, dt_s: float, limit_mps2: float, limit_mps: float) -> float:
    """Return a robot's velocity along an axis a window later: v + u Δt, both clipped."""
    u = min(max(u, -limit_mps2), limit_mps2)
    return min(max(v + u * dt_s, -limit_mps), limit_mps)


@compiled()
def _kick(
    qpos: Float[np.ndarray, "B N D"],
    qvel: Float[np.ndarray, "B N D"],
    ctrl: Float[np.ndarray, "B N D"],
    acceleration: Float[np.ndarray, "B N D"],
    dt_s: float,
    limit_mps2: float,
    limit_mps: float,
    wall_m: float,
    clips: bool,  # the robot onto the wall, in place of its mirror image behind it
    position: Float[np.ndarray, "B N D"],
    velocity: Float[np.ndarray, "B N D"],
) -> None:
    """Accelerate, clip and reflect; qpos has already moved by v dt. Copy p and v."""
    num_missions, num_robots = acceleration.shape[:2]
    for b in range(num_missions):
        for i in range(num_robots):
            for axis in range(PLANE):
                v = next_velocity(
                    ctrl[b, i, axis], acceleration[b, i, axis], dt_s, limit_mps2, limit_mps
                )
                p = qpos[b, i, axis]
                while abs(p) > wall_m:
                    edge = wall_m if p > 0 else -wall_m
                    p = edge if clips else 2 * edge - p
                    v = -v
                    qpos[b, i, axis] = p
                    qvel[b, i, axis] = -qvel[b, i, axis]  # the wall's impulse
                ctrl[b, i, axis] = v
                position[b, i, axis] = p
                velocity[b, i, axis] = v
