"""The interface of controllers: accelerations, and perhaps a task cost.

Index order: `[b, i]` is robot `i` of mission `b`.
"""

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import Buffers

STIFFNESS_PER_S2 = 0.25  # k: a robot begins to brake V_max c / k before its target, 12 m by default
DAMPING_PER_S = 1.0  # c: critical, 2 sqrt(k)


@runtime_checkable
class Controller(Protocol):
    """Drives the robots by what they have heard.

    A controller that draws or remembers is also `Started`: it gets the missions' random streams.
    """

    def __call__(self, buffers: Buffers, states: RobotStates, /) -> Float[np.ndarray, "B N 2"]:
        """Return the accelerations u [m/s²], which the physics clips to plus or minus A_max.

        Args:
            buffers: What each robot has heard; read-only. Row [b, i] may use row [b, i] only.
            states: The robots' own states.
        """
        ...


@runtime_checkable
class Costed(Protocol):
    """A controller with a task cost, next to the age of information."""

    cost_name: str  # such as "formation error"
    cost_unit: str  # such as "m"

    def cost(self, states: RobotStates, /) -> Float[np.ndarray, "B"]:
        """Return the task cost of these states, per mission; 0 or more."""
        ...


def costed(controller: Controller) -> Costed | None:
    """Return a controller that has a task cost, or None.

    Raises:
        TypeError: It has a cost without a name or a unit.
    """
    if isinstance(controller, Costed):
        return controller
    if hasattr(controller, "cost"):
        raise TypeError(
            "the controller has a cost, which needs a name and a unit; set its cost_name and "
            'cost_unit, such as "spread of the team" and "m"'
        )
    return None


def steer(target_m: Float[np.ndarray, "B N 2"], states: RobotStates) -> Float[np.ndarray, "B N 2"]:
    """Accelerate towards targets [m], critically damped: k (target - p) - c v [m/s²]."""
    apart_m = target_m - states.position_m
    return STIFFNESS_PER_S2 * apart_m - DAMPING_PER_S * states.velocity_mps
