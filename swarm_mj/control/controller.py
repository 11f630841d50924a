"""What drives the robots: a controller, and what it may declare beside its accelerations.

Index order: `[b, i]` is robot `i` of mission `b`.
"""

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import Buffers


@runtime_checkable
class Controller(Protocol):
    """What the robots want in the next window, from what they have heard.

    One that draws or remembers is also `Started`: it gets the missions' own random streams.
    """

    def __call__(self, buffers: Buffers, states: RobotStates, /) -> Float[np.ndarray, "B N 2"]:
        """Return the accelerations u [m/s²]; row [b, i] may use buffer and body [b, i] only.

        Args:
            buffers: What each robot has heard; they cannot be written.
            states: The robots' own states.

        Returns:
            The accelerations; the physics clips them to plus or minus A_max.
        """
        ...


@runtime_checkable
class Costed(Protocol):
    """A controller that says what its task costs, beside the age of information."""

    cost_name: str  # such as "formation error"
    cost_unit: str  # such as "m"

    def cost(self, states: RobotStates, /) -> Float[np.ndarray, "B"]:
        """What the task costs while the robots are like this, per mission; 0 or more."""
        ...


def costed(controller: Controller) -> Costed | None:
    """Return a controller that says what its task costs, or None.

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


STIFFNESS_PER_S2 = 0.25  # k: a robot begins to brake V_max c / k before its target, 12 m by default
DAMPING_PER_S = 1.0  # c: critical, 2 sqrt(k)


def steer(target_m: Float[np.ndarray, "B N 2"], states: RobotStates) -> Float[np.ndarray, "B N 2"]:
    """Accelerations towards targets, critically damped: k (target - p) - c v [m/s²].

    Args:
        target_m: Where each robot wants to be [m].
        states: The robots' own states.

    Returns:
        The accelerations, not yet clipped.
    """
    apart_m = target_m - states.position_m
    return STIFFNESS_PER_S2 * apart_m - DAMPING_PER_S * states.velocity_mps
