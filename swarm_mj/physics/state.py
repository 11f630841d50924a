"""The robots' true states."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

ROBOT_RADIUS_M = 0.5  # assets/robot.xml
ROBOT_HEIGHT_M = 1.0  # of its centre, and of its antenna, above the floor


@dataclass(frozen=True, kw_only=True)
class RobotStates:
    """Where the robots truly are and who is active, in all B missions at once."""

    position_m: Float[np.ndarray, "B N 2"]  # p [m]
    velocity_mps: Float[np.ndarray, "B N 2"]  # v [m/s]
    is_active: Bool[np.ndarray, "B N"] | None = None  # who observes and talks; None: everyone

    def copy(self) -> "RobotStates":
        """Return the same in arrays of its own."""
        return RobotStates(
            position_m=self.position_m.copy(),
            velocity_mps=self.velocity_mps.copy(),
            is_active=None if self.is_active is None else self.is_active.copy(),
        )
