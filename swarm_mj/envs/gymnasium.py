"""The Gymnasium face: a team under one controller, whose action is everyone's recipient."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import EzPickle
from jaxtyping import Bool, UInt8

from swarm_mj.envs.mission_batch import Info, Observation, seed_or_next
from swarm_mj.envs.options import check_reset, make_team_batch, team_spaces
from swarm_mj.envs.screen import RENDERING, Screen
from swarm_mj.mission import Mission


class SwarmEnv(gymnasium.Env[Observation, np.ndarray], EzPickle):
    """One mission; a step is a window, and it is cut off (truncated) after the last one.

    `reset(seed=s)` begins the mission of seed s, the one that `swarm-mj fly --seed s` flies;
    without a seed it begins another one, drawn from the last seed given.
    """

    metadata = RENDERING

    def __init__(
        self, mission: Mission | str = "flocking", *, render_mode: str | None = None, **options: Any
    ) -> None:
        """Take a mission or its task, and options of `make_batch`; raises as that does."""
        EzPickle.__init__(self, mission, render_mode=render_mode, **options)
        self.batch = make_team_batch(mission, **options)
        self._screen, self.render_mode = Screen(render_mode), render_mode
        self.observation_space, self.action_space = team_spaces(self.batch)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, Info]:
        """Begin a mission, whose seed is in `info`; raise ValueError for any options."""
        check_reset(options or {})
        super().reset(seed=seed, options=options)
        self.batch.restart([seed_or_next(seed, self.np_random)])
        return self._seen()

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, Info]:
        """Fly one window; `action[i]` is the recipient of robot i, itself for silence.

        Raises:
            ValueError: The action is not one integer from 0 to N - 1 per robot, or the mission is
                over.
        """
        reward = self.batch.step(np.asarray(action)[np.newaxis])
        observation, info = self._seen()
        return observation, float(reward[0, 0]), False, self.batch.is_over, info

    def action_masks(self) -> Bool[np.ndarray, "A"]:
        """Return where an action may help, robot by robot, in the form of `MaskablePPO`."""
        return self.batch.observation["action_mask"].ravel().astype(np.bool_)

    def render(self) -> UInt8[np.ndarray, "H W 3"] | None:
        """Draw the mission as it is now, in the mode "rgb_array"; raises OSError without OpenGL."""
        return self._screen.picture(self.batch)

    def close(self) -> None:
        """Give back what pictures took."""
        self._screen.close()

    def _seen(self) -> tuple[Observation, Info]:
        self._screen.update(self.batch)
        return self.batch.first()
