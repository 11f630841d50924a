"""Pictures of environments, drawn when one is asked for."""

import numpy as np
from jaxtyping import UInt8

from swarm_mj.envs.team import Team
from swarm_mj.rendering.contents import contents_of
from swarm_mj.rendering.scene import SceneRenderer

RENDER_MODES = ("human", "rgb_array")
RENDERING = {"render_modes": list(RENDER_MODES), "render_fps": 10}  # a window of 100 ms a picture
WIDTH, HEIGHT = 800, 600  # of a picture [pixels]


class Screen:
    """Shows missions as MuJoCo draws them: robots coloured by their age, and packets as arcs.

    OpenGL starts with the first picture.
    """

    def __init__(self, mode: str | None) -> None:
        """Takes a render mode, or None, in which there are no pictures.

        Raises:
            ValueError: There is no such mode.
        """
        if mode not in (None, *RENDER_MODES):
            raise ValueError(f"render_mode must be one of {', '.join(RENDER_MODES)}, not {mode!r}")
        self.mode = mode
        self._renderer: SceneRenderer | None = None

    def picture(self, team: Team, index: int = 0) -> UInt8[np.ndarray, "H W 3"]:
        """One of a team's missions as it is now, RGB.

        Raises:
            ValueError: It has not begun.
            OSError: No OpenGL works here; it says what to install.
        """
        contents = contents_of(team.flown, index)
        if self._renderer is None:
            self._renderer = SceneRenderer(team.mission, WIDTH, HEIGHT, scene=team.flown.scene)
        return self._renderer.frame(contents)

    def close(self) -> None:
        """Gives back what pictures took."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
