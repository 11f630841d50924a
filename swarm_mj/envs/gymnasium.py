"""The Gymnasium face: a team under one controller, whose action is whom each robot addresses."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import EzPickle
from jaxtyping import Bool, UInt8

from swarm_mj.envs.mission_batch import Info, Observation, next_seed
from swarm_mj.envs.options import check_reset, check_team_reward, make_batch
from swarm_mj.envs.screen import RENDERING, Screen
from swarm_mj.envs.spaces import team_spaces
from swarm_mj.mission import Mission


class SwarmEnv(gymnasium.Env[Observation, np.ndarray], EzPickle):
    """One mission; a step is a window, and it is cut off (truncated) after the last one.

    `reset(seed=s)` begins the mission of seed s, the one that `swarm-mj fly --seed s` flies;
    without a seed it begins another one, drawn from the last seed given.
    """

    metadata = RENDERING

    def __init__(
        self,
        mission: Mission | str = "flocking",
        *,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        """Take a mission or its task, and options of `make_batch`, such as fields of `Mission`.

        Raises:
            ValueError: A value is unknown or out of range.
            TypeError: An option is unknown.
        """
        EzPickle.__init__(self, mission, render_mode=render_mode, **options)
        self.batch = make_batch(mission, **options)
        check_team_reward(self.batch)
        self._screen = Screen(render_mode)
        self.render_mode = render_mode
        self.observation_space, self.action_space = team_spaces(self.batch)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, Info]:
        """Begin a mission, whose seed is in `info`. There are no options.

        Raises:
            ValueError: There is such an option, or no connected team could be drawn.
        """
        check_reset(options or {})
        super().reset(seed=seed, options=options)
        begun = next_seed(self.np_random) if seed is None else seed
        self.batch.restart([begun])
        self._screen.update(self.batch)
        return self._observation(), self._info()

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, Info]:
        """Fly one window; `action[i]` is whom robot i addresses, itself for silence.

        Returns:
            What the robots see, the reward, False, whether the mission was cut off here, and what
            the window cost.

        Raises:
            ValueError: The action is not one integer from 0 to N - 1 per robot, or the mission is
                over.
        """
        reward = self.batch.step(np.asarray(action)[np.newaxis])
        self._screen.update(self.batch)
        is_over = self.batch.is_over
        return self._observation(), float(reward[0, 0]), False, is_over, self._info()

    def action_masks(self) -> Bool[np.ndarray, "A"]:
        """Return where an action may help, robot by robot, in the form of `MaskablePPO`."""
        return self.batch.observation["action_mask"].ravel().astype(np.bool_)

    def render(self) -> UInt8[np.ndarray, "H W 3"] | None:
        """Return the mission as it is now, in the render mode "rgb_array".

        Raises:
            OSError: No OpenGL works here; it says what to install.
        """
        return self._screen.picture(self.batch) if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Give back what pictures took."""
        self._screen.close()

    def _info(self) -> Info:
        return {name: values[0].item() for name, values in self.batch.infos().items()}

    def _observation(self) -> Observation:
        return {name: values[0] for name, values in self.batch.observation.items()}
