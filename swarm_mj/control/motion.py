"""Controllers: their interface, and the paper's (IV-A), which stand, walk or flock.

A new task is a name of `mission.team.Task` and its controller here, which `controller_of`
returns; the type checker finds a task without one. If the controller has a cost (`Costed`), tables,
charts, files and rewards show it by its name and unit. Unless said otherwise, robots of a task move
from the start (`Mission.moves`) within walls (`mission.presets.paper`).

Index order: `[b, i]` is robot `i` of mission `b`.
"""

from collections.abc import Sequence
from typing import Protocol, assert_never, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.mission import FlockingSet, Mission
from swarm_mj.mission.batched_rng import Stream, normal
from swarm_mj.mission.geometry import PLANE
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import Buffers
from swarm_mj.protocol.costs import velocity_variance
from swarm_mj.protocol.mission_costs import VELOCITY_VARIANCE
from swarm_mj.system.compiled import compiled


@runtime_checkable
class Controller(Protocol):
    """Drives the robots by what they have heard.

    A controller that draws or remembers is also `Started`: it gets the missions' random streams.
    """

    def __call__(self, buffers: Buffers, states: RobotStates, /) -> Float[np.ndarray, "B N D"]:
        """Return the accelerations u [m/s²], which the physics clips to plus or minus A_max.

        Buffers are read-only. Row [b, i] may use row [b, i] of them and of the states only.
        """
        ...


@runtime_checkable
class Costed(Protocol):
    """A controller with a task cost, next to the age of information."""

    cost_name: str  # such as "velocity variance"
    cost_unit: str  # such as "m²/s²"

    def cost(self, states: RobotStates, /) -> Float[np.ndarray, "B"]:
        """Return the task cost of these states, per mission; 0 or more."""
        ...


def costed(controller: Controller) -> Costed | None:
    """Return a controller that has a task cost, or None; TypeError if it lacks name or unit."""
    if isinstance(controller, Costed):
        return controller
    if hasattr(controller, "cost"):
        raise TypeError(
            "the controller has a cost, which needs a name and a unit; set its cost_name and "
            'cost_unit, such as "spread of the team" and "m"'
        )
    return None


def controller_of(mission: Mission) -> Controller:
    """Return the controller of a mission's task, to be started if it is `Started`."""
    match mission.task:
        case "stationary":
            return stand
        case "random-walk":
            return RandomWalk(mission)
        case "flocking":
            return Flocking(mission)
        case _:
            assert_never(mission.task)  # a type error here is a task without a controller


def initial_velocity(mission: Mission, rng: np.random.Generator) -> Float[np.ndarray, "N D"]:
    """Draw the initial velocities [m/s]: uniform in plus or minus V_max per axis, or 0 (IV-A).

    Of bodies they are those in the plane; none climbs.
    """
    if not mission.moves:
        return np.zeros((mission.num_robots, mission.num_axes))
    limit = mission.max_velocity_mps
    velocity_mps = np.zeros((mission.num_robots, mission.num_axes))
    velocity_mps[:, :PLANE] = rng.uniform(-limit, limit, size=(mission.num_robots, PLANE))
    return velocity_mps


def stand(_buffers: Buffers, states: RobotStates) -> Float[np.ndarray, "B N D"]:
    """Accelerate no robot."""
    return np.zeros_like(states.velocity_mps)


class RandomWalk:
    """u ~ N(0, A_max / 3), a standard deviation per axis (IV-A), which the physics clips."""

    def __init__(self, mission: Mission) -> None:
        self._deviation_mps2 = mission.max_acceleration_mps2 / 3.0

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Give every robot its own stream of numbers; arguments as in `Started.start`."""
        self._stream = Stream(rngs, normal, (num_robots, PLANE))

    def __call__(self, _buffers: Buffers, states: RobotStates) -> Float[np.ndarray, "B N D"]:
        """Return the next accelerations [m/s²], which climb nowhere."""
        drawn_mps2 = self._stream.next() * self._deviation_mps2
        if states.velocity_mps.shape[2] == PLANE:
            return drawn_mps2
        acceleration_mps2 = np.zeros_like(states.velocity_mps)
        acceleration_mps2[..., :PLANE] = drawn_mps2
        return acceleration_mps2


class Flocking:
    """Velocity consensus by `flocking` (IV-A)."""

    cost_name = VELOCITY_VARIANCE.title
    cost_unit = VELOCITY_VARIANCE.unit

    def __init__(self, mission: Mission) -> None:
        self._flocking_set: FlockingSet = mission.flocking_set

    def __call__(self, buffers: Buffers, states: RobotStates) -> Float[np.ndarray, "B N D"]:
        """Return the next accelerations [m/s²]."""
        return flocking(buffers, states.velocity_mps, self._flocking_set)

    def cost(self, states: RobotStates, /) -> Float[np.ndarray, "B"]:
        """Return the velocity variance of the active robots [m²/s²]."""
        return velocity_variance(states.velocity_mps, states.is_active)


def flocking(
    buffers: Buffers, velocity_mps: Float[np.ndarray, "B N D"], flocking_set: FlockingSet
) -> Float[np.ndarray, "B N D"]:
    """Return the mean difference of known velocities to the own one, per second [m/s²] (Eq. 16).

    The flocking set F is of robots with T > T_0 (`heard`, the paper) or, per axis, with a velocity
    other than 0 in the buffer (`moving`, the authors' code). The robot itself is in it; while F is
    empty the acceleration is 0.

    Args:
        buffers: What each robot knows of the others' velocities, [B N N D], [m/s], and of whom it
            knows anything, [B N N].
        velocity_mps: The robots' own velocities, [B N D], [m/s].
        flocking_set: "heard" or "moving".

    Returns:
        The accelerations u, [B N D], [m/s²]; the physics clips them.
    """
    is_counted = None if flocking_set == "moving" else buffers.is_known
    return _mean_difference(is_counted, buffers.velocity_mps, velocity_mps)


@compiled()
def _mean_difference(
    is_counted: Bool[np.ndarray, "B N N"] | None,
    known_mps: Float[np.ndarray, "B N N D"],
    velocity_mps: Float[np.ndarray, "B N D"],
) -> Float[np.ndarray, "B N D"]:
    num_missions, num_robots = known_mps.shape[:2]
    acceleration = np.zeros_like(velocity_mps)
    for b in range(num_missions):
        for i in range(num_robots):
            for axis in range(velocity_mps.shape[2]):
                total = 0.0
                num_counted = 0
                for j in range(num_robots):
                    known = known_mps[b, i, j, axis]
                    counts = known != 0.0 if is_counted is None else is_counted[b, i, j]
                    if counts:
                        total += known - velocity_mps[b, i, axis]
                        num_counted += 1
                if num_counted:
                    acceleration[b, i, axis] = total / num_counted
    return acceleration
