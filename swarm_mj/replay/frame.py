"""The part of the ground that the replay's map shows: the area, or the team that has left it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

NEAR = 1.5  # times the area: robots that stay within it are shown around the area


@dataclass(frozen=True, kw_only=True)
class Frame:
    """A square of constant size that may move."""

    centre_m: Float[np.ndarray, "T 2"]  # in each window [m]
    reach_m: float  # half its width [m]

    @property
    def moves(self) -> bool:
        """Whether it follows the team."""
        return bool(np.any(self.centre_m))


def frame(position_m: Float[np.ndarray, "T N 2"], half_side_m: float) -> Frame:
    """Return the smallest square that holds the area and all ways, or else all robots at any time.

    It follows the team if robots go far beyond the area, which is centred on the origin.
    """
    farthest_m = float(np.max(np.abs(position_m)))
    if farthest_m <= NEAR * half_side_m:
        centre_m = np.zeros((len(position_m), 2))
        return Frame(centre_m=centre_m, reach_m=max(half_side_m, farthest_m))
    low_m, high_m = np.min(position_m, axis=1), np.max(position_m, axis=1)
    return Frame(centre_m=(low_m + high_m) / 2.0, reach_m=float(np.max(high_m - low_m)) / 2.0)
