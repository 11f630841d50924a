"""Path loss over a distance: free space to a breakpoint, and a steeper slope beyond it.

The paper's radio is free space everywhere (Eq. 1). The two other laws agree with it up to their
breakpoint, so a mission's transmit power means the same under each of them.
"""

import math
from dataclasses import dataclass

from swarm_mj.radio.free_space import path_loss_db
from swarm_mj.radio.reception import received_power
from swarm_mj.system.compiled import compiled

SPEED_OF_LIGHT_MPS = 299_792_458.0
FREE_SPACE_EXPONENT = 2.0


@dataclass(frozen=True, kw_only=True)
class PathLoss:
    """Free space up to a breakpoint, then 10 n dB for every tenfold distance."""

    breakpoint_m: float = math.inf
    exponent: float = FREE_SPACE_EXPONENT  # n, beyond the breakpoint

    def loss_db(self, distance_m: float, frequency_hz: float) -> float:
        """Return the loss [dB]."""
        near_m = min(distance_m, self.breakpoint_m)
        beyond_db = 10.0 * self.exponent * math.log10(distance_m / near_m)
        return path_loss_db(near_m, frequency_hz) + beyond_db


FREE_SPACE = PathLoss()


def log_distance(exponent: float, reference_m: float) -> PathLoss:
    """Log-distance path loss (Rappaport 2002, Eq. 4.69): free space up to the reference distance.

    Args:
        exponent: n; 2 is free space, 2.7 to 3.5 an urban area, 4 to 6 indoors behind walls.
        reference_m: d_0 [m].

    Returns:
        The law.
    """
    return PathLoss(breakpoint_m=reference_m, exponent=exponent)


def two_ray_ground(height_m: float, frequency_hz: float) -> PathLoss:
    """Two-ray ground reflection (Rappaport 2002, Eq. 4.52): 40 dB per decade far out.

    Free space holds up to the crossover distance 4 pi h^2 / lambda, from which on the reflection
    from the ground nearly cancels the direct ray and the loss is d^4 / h^4.

    Args:
        height_m: h, of all antennas above the ground [m].
        frequency_hz: Of the carrier [Hz].

    Returns:
        The law.
    """
    wavelength_m = SPEED_OF_LIGHT_MPS / frequency_hz
    return PathLoss(breakpoint_m=4.0 * math.pi * height_m**2 / wavelength_m, exponent=4.0)


@compiled()
def power_after(
    at_1_m: float, squared_distance_m2: float, breakpoint_m: float, exponent: float
) -> float:
    """Power that is left over a distance, in the unit of that which free space leaves over 1 m."""
    power = received_power(at_1_m, squared_distance_m2)
    squared_breakpoint_m2 = breakpoint_m * breakpoint_m
    if squared_distance_m2 <= squared_breakpoint_m2:
        return power
    beyond = squared_breakpoint_m2 / squared_distance_m2
    return power * beyond ** (0.5 * exponent - 1.0)
