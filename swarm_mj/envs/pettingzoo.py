"""PettingZoo's interface: every robot is an agent, `robot_0` to `robot_{N-1}`."""

from collections.abc import Mapping
from typing import Any, Unpack

import numpy as np
from gymnasium import Space
from gymnasium.utils import EzPickle, seeding
from jaxtyping import Float32, UInt8
from pettingzoo import ParallelEnv

from swarm_mj.envs.gymnasium import MODES, Screen, modes_here, rendering
from swarm_mj.envs.mission_batch import Info, Observation, seed_or_next
from swarm_mj.envs.options import BatchOptions, make_batch, robot_spaces, truth, truth_space
from swarm_mj.mission import Mission
from swarm_mj.protocol.checks import as_array, checked_robots
from swarm_mj.system.arguments import check_kind

Action = int | np.integer[Any]
NAME = {"name": "swarm_mj_v0"}


class SwarmParallelEnv(ParallelEnv[str, Observation, Action], EzPickle):
    """One mission; a step is a window, and all are cut off (truncated) after the last one.

    A robot that fails is terminated, and drops out. `reset(seed=s)` begins the mission of
    seed s; without a seed it begins another one, drawn from the last seed given.
    """

    metadata: dict[str, Any] = NAME | rendering(Mission(), MODES)

    def __init__(
        self,
        mission: Mission | str = "flocking",
        *,
        render_mode: str | None = None,
        **options: Unpack[BatchOptions],
    ) -> None:
        """Take a mission, and how it is shown and paid.

        Args:
            mission: The mission, or its task.
            render_mode: "rgb_array", "human", or None for no pictures.
            **options: As of `make_batch`: the reward, the features, and any field of `Mission`.

        Raises:
            ValueError: If a value is unknown or out of range, or does not go with another.
            TypeError: If an option is unknown, or a component cannot be called.
        """
        EzPickle.__init__(self, mission, render_mode=render_mode, **options)
        self.batch = make_batch(mission, **options)
        self._screen = Screen(render_mode)
        self.render_mode = render_mode
        self.metadata = NAME | rendering(self.batch.mission, modes_here())
        self.possible_agents = [f"robot_{i}" for i in range(self.batch.mission.num_robots)]
        self.agents: list[str] = []
        self._robot = {agent: i for i, agent in enumerate(self.possible_agents)}
        # One object for each agent: PettingZoo seeds them one by one.
        self.observation_spaces: dict[str, Space[Any]] = {}
        self.action_spaces: dict[str, Space[Any]] = {}
        for agent in self.possible_agents:
            self.observation_spaces[agent], self.action_spaces[agent] = robot_spaces(self.batch)
        self.state_space = truth_space(self.batch.mission)
        self._rng, _ = seeding.np_random()

    def observation_space(self, agent: str) -> Space[Any]:
        """Return the space of an agent's view; see `robot_spaces`.

        Args:
            agent: Its name, `robot_0` to `robot_{N-1}`.

        Returns:
            The agent's own space, the same object on every call.

        Raises:
            KeyError: If there is no such agent.
        """
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Space[Any]:
        """Return the space of an agent's recipients, 0 to N - 1; its own number is silence.

        Args:
            agent: Its name, `robot_0` to `robot_{N-1}`.

        Returns:
            The agent's own space, the same object on every call.

        Raises:
            KeyError: If there is no such agent.
        """
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, Info]]:
        """Begin a mission, whose seed is in every agent's info.

        Args:
            seed: The mission's, an integer of 0 or more; None draws another mission from the last
                seed given.
            options: Ignored.

        Returns:
            The views and the infos, by agent. A view has `observation` [N F] and `action_mask` [N],
            `parent` [N] if the option `with_parents` is set, and `sensors` [S] if `with_sensors`
            is; an info has the seed and the team's costs.

        Raises:
            ValueError: If no connected team could be drawn.
            gymnasium.error.Error: If the seed is not an integer of 0 or more.
            OSError: In the mode "human", if there is no display.

        Example:
            >>> views, infos = parallel_env("flocking", num_robots=5).reset(seed=1)
        """
        del options
        if seed is not None:
            self._rng, _ = seeding.np_random(seed)
        self.batch.restart([seed_or_next(seed, self._rng)])
        self.agents = list(self.possible_agents)
        return self._seen()

    def step(
        self, actions: dict[str, Action]
    ) -> tuple[
        dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, Info]
    ]:
        """Fly one window, in which each agent addresses a robot.

        An agent without an action is silent, and so is one that has dropped out whatever it does.

        Args:
            actions: The recipient of each agent, from 0 to N - 1; its own number is silence.

        Returns:
            By agent, of those that were left before the window: its view; its reward, in the unit
            of the option `reward`; whether it has failed (terminated); whether this was the last
            window (truncated); and its info, which has the team's costs. All are empty once no
            agent is left.

        Raises:
            ValueError: If there is no such agent, an action is no robot, or no mission has begun;
                then nothing has moved.
            OSError: In the mode "human", if there is no display.
        """
        check_kind("actions", actions, Mapping, '{"robot_0": 1}')
        [chosen] = self.batch.flown.views.silence.tolist()
        for agent, action in actions.items():
            if agent not in self._robot:
                names = f"{self.possible_agents[0]} to {self.possible_agents[-1]}"
                raise ValueError(f"agents are {names}, not {agent!r:.80}; leave it out")
            if agent in self.agents:
                chosen[self._robot[agent]] = as_array("action", action).squeeze()  # some wrap it
        if not self.agents:
            return {}, {}, {}, {}, {}
        recipient = checked_robots("action", [chosen], self.batch.shape)
        reward = self.batch.step(recipient)[0]
        is_over = self.batch.is_over
        seen, infos = self._seen()
        rewards = {agent: float(reward[self._robot[agent]]) for agent in self.agents}
        ended = {agent: not self.batch.is_active[0, self._robot[agent]] for agent in self.agents}
        cut = dict.fromkeys(self.agents, is_over)
        self.agents = [] if is_over else [agent for agent in self.agents if not ended[agent]]
        return seen, rewards, ended, cut, infos

    def state(self) -> Float32[np.ndarray, "S"]:
        """Return the truth, for a centralised critic; no robot observes it; see `truth`.

        Returns:
            Normalised numbers without a unit, [S], where S = 1 + N (2 D + 1 + N); D is 2 axes of
            points, 3 of bodies.

        Raises:
            ValueError: If no mission has begun.
        """
        return truth(self.batch)[0]

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
        """Release what pictures took: the renderer, or the viewer's window."""
        self._screen.close()

    def _seen(self) -> tuple[dict[str, Observation], dict[str, Info]]:
        self._screen.update(self.batch)
        seen, info = self.batch.first()
        views: dict[str, Observation] = {}
        infos: dict[str, Info] = {}
        for agent in self.agents:
            robot = self._robot[agent]
            views[agent] = {name: rows[robot] for name, rows in seen.items()}
            infos[agent] = dict(info)
        return views, infos


def parallel_env(
    mission: Mission | str = "flocking",
    *,
    render_mode: str | None = None,
    **options: Unpack[BatchOptions],
) -> SwarmParallelEnv:
    """Return a mission as PettingZoo's `ParallelEnv`, by the usual name; see the class.

    Args:
        mission: The mission, or its task.
        render_mode: As of `SwarmParallelEnv`.
        **options: As of `make_batch`: the reward, the features, and any field of `Mission`.

    Returns:
        The environment; `reset` begins its first mission.

    Raises:
        ValueError: If a value is unknown or out of range, or does not go with another.
        TypeError: If an option is unknown, or a component cannot be called.

    Example:
        >>> env = parallel_env("random-walk", num_robots=10, reward="credit")
    """
    return SwarmParallelEnv(mission, render_mode=render_mode, **options)
