"""Gymnasium's interface: a team under one controller, whose action is everyone's recipient.

The vector environment and PettingZoo's draw on the same screen.
"""

import copy
import time
from collections.abc import Sequence
from typing import Any, Unpack

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils import EzPickle
from jaxtyping import Bool, UInt8

from swarm_mj.envs.mission_batch import Info, MissionBatch, Observation, seed_or_next
from swarm_mj.envs.options import BatchOptions, make_team_batch, team_spaces
from swarm_mj.mission import Mission
from swarm_mj.protocol.checks import as_array
from swarm_mj.replay.recorder import moment
from swarm_mj.replay.rendering.scene import SceneRenderer, SceneViewer
from swarm_mj.replay.view import has_display
from swarm_mj.system.arguments import check_choice

MODES = ("rgb_array", "human")
WIDTH = 800  # of a picture [pixels]
HEIGHT = 600


def rendering(mission: Mission, modes: Sequence[str]) -> dict[str, Any]:
    """Return an environment's metadata: how it can be drawn, and windows a second."""
    return {"render_modes": list(modes), "render_fps": 1.0 / mission.window_s}


def modes_here() -> list[str]:
    """Return the render modes that can work on this machine, so that checkers try no others."""
    return [mode for mode in MODES if mode != "human" or has_display()]


class Screen:
    """Missions as MuJoCo draws them: robots coloured by their age, and packets as arcs.

    The mode "rgb_array" gives pictures on request; "human" shows every window of the mission, not
    faster than it would last. Either starts when it is needed.
    """

    def __init__(self, mode: str | None, modes: Sequence[str] = MODES) -> None:
        """Take a render mode, or None for no pictures; raises ValueError for an unknown one."""
        if mode is not None:
            check_choice("render_mode", mode, modes)
        self.mode = mode
        self._shown_s = 0.0
        self._renderer: SceneRenderer | None = None
        self._viewer: SceneViewer | None = None

    def update(self, batch: MissionBatch) -> None:
        """Show the first mission, in the mode "human"; raises OSError without a display."""
        if self.mode != "human":
            return
        if self._viewer is None:
            self._viewer = SceneViewer(batch.mission, scene=batch.flown.scene)
        self._viewer.show(moment(batch.flown))
        time.sleep(max(0.0, self._shown_s + batch.mission.window_s - time.monotonic()))
        self._shown_s = time.monotonic()

    def picture(self, batch: MissionBatch, index: int = 0) -> UInt8[np.ndarray, "H W 3"] | None:
        """Draw a mission as it is now, in the mode "rgb_array"; raises OSError without OpenGL."""
        if self.mode != "rgb_array":
            return None
        footage = moment(batch.flown, index)
        if self._renderer is None:
            self._renderer = SceneRenderer(batch.mission, WIDTH, HEIGHT, scene=batch.flown.scene)
        return self._renderer.frame(footage)

    def close(self) -> None:
        """Give back what pictures took."""
        for shown in (self._renderer, self._viewer):
            if shown is not None:
                shown.close()
        self._renderer = self._viewer = None


class SwarmEnv(gymnasium.Env[Observation, np.ndarray], EzPickle):
    """One mission; a step is a window, and it is cut off (truncated) after the last one.

    `reset(seed=s)` begins the mission of seed s, the one that `swarm-mj fly --seed s` flies;
    without a seed it begins another one, drawn from the last seed given.
    """

    metadata = rendering(Mission(), MODES)
    _spec: EnvSpec | None = None

    def __init__(
        self,
        mission: Mission | str = "flocking",
        *,
        render_mode: str | None = None,
        **options: Unpack[BatchOptions],
    ) -> None:
        """Take a mission or its task, and options of `make_batch`; raises as that does."""
        EzPickle.__init__(self, mission, render_mode=render_mode, **options)
        self.batch = make_team_batch(mission, **options)
        self._screen = Screen(render_mode)
        self.render_mode = render_mode
        self.metadata = rendering(self.batch.mission, modes_here())
        self.observation_space, self.action_space = team_spaces(self.batch)

    @property
    def spec(self) -> EnvSpec | None:
        """Where `gymnasium.make` found this, with `max_episode_steps`; it adds no time limit."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:  # pyright: ignore[reportIncompatibleVariableOverride]
        self._spec = copy.copy(spec)
        if self._spec is not None:
            self._spec.max_episode_steps = self.batch.mission.num_windows

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, Info]:
        """Begin a mission, whose seed is in `info`.

        Args:
            seed: The mission's, an integer of 0 or more; None draws another mission from the last
                seed given.
            options: Ignored.

        Returns:
            The team's observation and the info. The observation has `observation` [N N F] and
            `action_mask` [N N], row i of each being robot i's, `parent` [N N] if the option
            `with_parents` is set, and `sensors` [N S] if `with_sensors` is. The info has the seed,
            and the costs by the names of `swarm-mj fly --json`.

        Raises:
            ValueError: If no connected team could be drawn.
            gymnasium.error.Error: If the seed is not an integer of 0 or more.
            OSError: In the mode "human", if there is no display.

        Example:
            >>> observation, info = SwarmEnv("flocking", num_robots=5).reset(seed=1)
        """
        super().reset(seed=seed, options=options)
        self.batch.restart([seed_or_next(seed, self.np_random)])
        return self._seen()

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, Info]:
        """Fly one window, in which each robot addresses the recipient that the action names.

        Args:
            action: The recipient of each robot, [N] integers from 0 to N - 1; itself is silence.

        Returns:
            The team's observation after the window; its reward, minus the cost that the option
            `reward` names, in its unit; False, as no mission terminates; whether this was the last
            window (truncated); and the info, as of `reset`.

        Raises:
            ValueError: If the action is not one integer from 0 to N - 1 per robot, if no mission
                has begun, or if it is over.
            OSError: In the mode "human", if there is no display.
        """
        reward = self.batch.step(as_array("action", action)[np.newaxis])
        observation, info = self._seen()
        return observation, float(reward[0, 0]), False, self.batch.is_over, info

    def action_masks(self) -> Bool[np.ndarray, "A"]:
        """Return where an action may help, robot by robot, in the form of `MaskablePPO`."""
        return self.batch.observation["action_mask"].ravel().astype(np.bool_)

    def render(self) -> UInt8[np.ndarray, "H W 3"] | None:
        """Draw the mission as it is now, in the mode "rgb_array".

        Returns:
            A picture, [H W 3] with H = 600 and W = 800 [pixels]; None in any other mode.

        Raises:
            ValueError: If no mission has begun.
            OSError: If OpenGL does not work here.
        """
        return self._screen.picture(self.batch)

    def close(self) -> None:
        """Give back what pictures took."""
        self._screen.close()

    def _seen(self) -> tuple[Observation, Info]:
        self._screen.update(self.batch)
        return self.batch.first()
