"""Pictures of environments, drawn when one is asked for."""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import UInt8

from swarm_mj.envs.mission_batch import MissionBatch
from swarm_mj.replay.footage import footage_now
from swarm_mj.replay.rendering.scene import SceneRenderer, SceneViewer

MODES = ("rgb_array", "human")
RENDERING: dict[str, Any] = {"render_modes": list(MODES), "render_fps": 10}  # 100 ms a window
WIDTH, HEIGHT = 800, 600  # of a picture [pixels]


class Screen:
    """Missions as MuJoCo draws them: robots coloured by their age, and packets as arcs.

    The mode "rgb_array" gives pictures on request; "human" shows every window of the mission, not
    faster than it would last. Either starts when it is needed.
    """

    def __init__(self, mode: str | None, modes: Sequence[str] = MODES) -> None:
        """Take a render mode, or None for no pictures; raises ValueError for an unknown one."""
        if mode is not None and mode not in modes:
            raise ValueError(f"render_mode must be one of {', '.join(modes)}, not {mode!r}")
        self.mode, self._shown_s = mode, 0.0
        self._renderer: SceneRenderer | None = None
        self._viewer: SceneViewer | None = None

    def update(self, batch: MissionBatch) -> None:
        """Show the first mission, in the mode "human"; raises OSError without a display."""
        if self.mode != "human":
            return
        if self._viewer is None:
            self._viewer = SceneViewer(batch.mission, scene=batch.flown.scene)
        self._viewer.show(footage_now(batch.flown))
        time.sleep(max(0.0, self._shown_s + batch.mission.window_s - time.monotonic()))
        self._shown_s = time.monotonic()

    def picture(self, batch: MissionBatch, index: int = 0) -> UInt8[np.ndarray, "H W 3"] | None:
        """Draw a mission as it is now, in the mode "rgb_array"; raises OSError without OpenGL."""
        if self.mode != "rgb_array":
            return None
        footage = footage_now(batch.flown, index)
        if self._renderer is None:
            self._renderer = SceneRenderer(batch.mission, WIDTH, HEIGHT, scene=batch.flown.scene)
        return self._renderer.frame(footage)

    def close(self) -> None:
        """Give back what pictures took."""
        for shown in (self._renderer, self._viewer):
            if shown is not None:
                shown.close()
        self._renderer = self._viewer = None
