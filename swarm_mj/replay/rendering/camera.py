"""A camera that looks down on a square of ground from the south, and where it sees what."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from mujoco._enums import mjtCamera
from mujoco._structs import MjvCamera

ELEVATION_DEG = 55.0  # of the camera above the ground: 90 would look straight down
FOV_Y_DEG = 32.0  # a long lens: what is near is hardly larger than what is far
SHIFT = 0.15  # of what it looks at, from the square's centre to the south, by half the side
MARGIN = 0.94  # of the picture, for the square
TAN = float(np.tan(np.deg2rad(FOV_Y_DEG / 2.0)))
SIN, COS = np.sin(np.deg2rad(ELEVATION_DEG)), np.cos(np.deg2rad(ELEVATION_DEG))


@dataclass(frozen=True, kw_only=True)
class Camera:
    """A perspective camera, north up; its picture has square pixels."""

    target_m: Float[np.ndarray, "2"]  # the point on the ground that is in the middle [m]
    distance_m: float  # from there [m]
    width: int  # [pixels]
    height: int

    @property
    def pixel_m(self) -> float:
        """The ground that a pixel in the middle of the picture shows, across [m]."""
        return 2.0 * self.distance_m * TAN / self.height

    def pixels(self, point_m: Float[np.ndarray, "K 3"]) -> Float[np.ndarray, "K 2"]:
        """Return points' places in the picture: right and down from its upper left corner."""
        across, up, ahead = _axes(point_m - np.append(self.target_m, 0.0))
        scale = self.height / (2.0 * TAN * (self.distance_m + ahead))
        return np.stack([self.width / 2 + across * scale, self.height / 2 - up * scale], axis=1)

    def aim(self, free: MjvCamera) -> None:
        """Let a camera of MuJoCo's see the same."""
        free.type = mjtCamera.mjCAMERA_FREE.value
        free.lookat[:] = (*self.target_m, 0.0)
        free.distance, free.azimuth, free.elevation = self.distance_m, 90.0, -ELEVATION_DEG


def look_at(centre_m: Float[np.ndarray, "2"], reach_m: float, width: int, height: int) -> Camera:
    """Return the camera whose picture of this size [pixels] shows a square of ground [m]."""
    corners = reach_m * np.array([[x, y, 0.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    # The near edge is seen under a wider angle than the far one: the target moves towards it.
    south_m = np.array([0.0, SHIFT * reach_m])
    across, up, ahead = _axes(corners + np.append(south_m, 0.0))
    needed = np.maximum(np.abs(across) * height / width, np.abs(up)) / (MARGIN * TAN) - ahead
    distance_m = float(np.max(needed))
    return Camera(target_m=centre_m - south_m, distance_m=distance_m, width=width, height=height)


def _axes(point_m: Float[np.ndarray, "K 3"]) -> Float[np.ndarray, "3 K"]:
    """Return points along the picture's axes from the target: right, up and ahead [m]."""
    x, y, z = point_m.T
    return np.stack([x, SIN * y + COS * z, COS * y - SIN * z])
