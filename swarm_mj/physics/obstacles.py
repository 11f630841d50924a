"""What stands in the way, as plain arrays: for loops that know no MuJoCo."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX = 2, 3, 4, 5, 6  # as MuJoCo numbers them


class Obstacles(NamedTuple):
    """The obstacles of a scene; the same in all missions."""

    kind: Int[np.ndarray, "O"]  # SPHERE, CAPSULE, ...; a mesh is the box around it
    centre_m: Float[np.ndarray, "O 3"]
    rotation: Float[np.ndarray, "O 3 3"]  # from the obstacle's frame to the scene's
    size_m: Float[np.ndarray, "O 3"]  # as MuJoCo's: radius and half length, or half sides
    reach_m: Float[np.ndarray, "O"]  # radius of the sphere around the centre that holds it
    power_left: Float[np.ndarray, "O"]  # share of the power that is left behind it, linear [1]
