"""The stable-baselines3 face: B missions behind one `VecEnv`, for its algorithms and sb3-contrib's.

An environment is one robot, or one team. All missions begin and end together.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from jaxtyping import Bool
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvStepReturn

from swarm_mj.envs.gymnasium import check_paid_together
from swarm_mj.envs.spaces import robot_spaces, team_spaces
from swarm_mj.envs.team import Observation, Team, next_seed
from swarm_mj.mission import Mission

AGENTS = ("robot", "team")  # what an environment is


def make_vec_env(
    mission: Mission | str = "flocking",
    num_missions: int = 1,
    *,
    agent: str = "robot",
    seed: int | None = None,
    **options: Any,
) -> "SwarmVecEnv":
    """Missions side by side for stable-baselines3, with `action_masks()` for `MaskablePPO`.

    Args:
        mission: The mission, or its task.
        num_missions: B.
        agent: What an environment is: a "robot", so that B N environments share one network that
            sees what one robot knows; or a "team", which decides for all at once.
        seed: Of the first mission; the others count on from it. Later missions are drawn from
            these; None draws the first ones, too.
        **options: As of `Team`: the reward, the features, and any field of `Mission`.

    Raises:
        ValueError: A value is unknown or out of range.
        TypeError: An option is unknown.
    """
    if agent not in AGENTS:
        raise ValueError(f"agent must be one of {', '.join(AGENTS)}, not {agent!r}")
    env = SwarmVecEnv(Team(mission, num_missions, **options), agent)
    env.seed(seed)
    return env


class SwarmVecEnv(VecEnv):
    """See `make_vec_env`; environments run mission by mission and, if a robot is one, by robot."""

    def __init__(self, team: Team, agent: str) -> None:
        """Takes missions that have not begun."""
        self.team = team
        self.agent = agent
        self.render_mode = None
        if agent == "team":
            check_paid_together(team)
        self._per_mission = team.mission.num_robots if agent == "robot" else 1
        make_spaces = robot_spaces if agent == "robot" else team_spaces
        super().__init__(team.num_missions * self._per_mission, *make_spaces(team))
        self.seed(None)

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Lets the next reset begin the missions of seeds from this one on; returns each one's."""
        missions = range(self.team.num_missions)
        self._given = [None if seed is None else seed + b for b in missions]
        self._rngs = [seeding.np_random(each)[0] for each in self._given]
        return [self._given[b] for b in missions for _ in range(self._per_mission)]

    def reset(self) -> Observation:
        """Begins the missions of the seeds given, and else others; their seeds are in infos."""
        begun = [
            next_seed(rng) if seed is None else seed
            for rng, seed in zip(self._rngs, self._given, strict=True)
        ]
        self._given = [None] * len(begun)
        self.team.restart(begun)
        self.reset_infos = [{"seed": seed} for seed in begun for _ in range(self._per_mission)]
        return self._observations()

    def step_async(self, actions: np.ndarray) -> None:
        """Takes the actions; `step_wait` plays them."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """One window of all missions; after the last one, others begin.

        Raises:
            ValueError: A recipient is no robot; nothing has moved.
        """
        shape = (self.team.num_missions, self.team.mission.num_robots)
        reward = self.team.step(self._actions.reshape(shape))[:, : self._per_mission].ravel()
        is_over = self.team.is_over
        infos = self._infos(is_over)
        seen = self.reset() if is_over else self._observations()
        return seen, reward.astype(np.float32), np.full(self.num_envs, is_over), infos

    def action_masks(self) -> Bool[np.ndarray, "E A"]:
        """Which actions are worth a thought: a recipient each, or a team's, robot by robot."""
        return self.team.observation["action_mask"].reshape(self.num_envs, -1).astype(np.bool_)

    def env_method(
        self,
        method_name: str,
        *_: object,
        indices: VecEnvIndices = None,
        **__: object,
    ) -> list[Any]:
        """`action_masks`, the one method of environments; raises AttributeError for others."""
        if method_name != "action_masks":
            raise AttributeError(f"no environment has its own {method_name}")
        masks = self.action_masks()
        return [masks[env] for env in self._get_indices(indices)]

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """The attribute of this object, once per environment."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, *_: object, **__: object) -> None:
        """Environments have no attributes of their own; raises AttributeError."""
        raise AttributeError(f"no environment has its own {attr_name}")

    def env_is_wrapped(self, wrapper_class: type, indices: VecEnvIndices = None) -> list[bool]:  # noqa: ARG002 - VecEnv's
        """No environment is wrapped."""
        return [False for _ in self._get_indices(indices)]

    def close(self) -> None:
        """There is nothing to release."""

    def _infos(self, is_over: bool) -> list[dict[str, Any]]:
        """What the window cost each mission; at its end, also what was seen."""
        costs = self.team.infos()
        infos: list[dict[str, Any]] = [
            {name: values[env // self._per_mission].item() for name, values in costs.items()}
            for env in range(self.num_envs)
        ]
        if is_over:
            last = self._observations()
            for env, info in enumerate(infos):
                info["terminal_observation"] = {name: each[env] for name, each in last.items()}
                info["TimeLimit.truncated"] = True
        return infos

    def _observations(self) -> Observation:
        """What all environments see."""
        seen = self.team.observation
        if self.agent == "team":
            return seen
        return {name: values.reshape(-1, *values.shape[2:]) for name, values in seen.items()}
