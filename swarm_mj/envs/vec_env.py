"""The `VecEnv` of stable-baselines3, whose environments are robots or teams.

Training's own, `learning.graph_vec_env`, differs in what its networks see, in who chooses the seeds
and in where missions end.
"""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, Literal, get_args

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from jaxtyping import Bool, Float, Int
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvStepReturn

from swarm_mj.envs.mission_batch import MissionBatch, Observation, seed_or_next, seeds_from
from swarm_mj.protocol.checks import as_array, checked_robots

Agent = Literal["robot", "team"]  # what an environment is
AGENTS: tuple[Agent, ...] = get_args(Agent)


class BatchVecEnv(VecEnv):
    """Missions, each batch of them one swarm; no Python loop runs over robots.

    Environments run batch by batch, mission by mission and, if a robot is one, robot by robot.
    """

    reward_unit = 1.0  # what agents are paid is divided by it

    def __init__(
        self,
        batches: Sequence[MissionBatch],
        agent: Agent,
        observation_space: spaces.Space,
        action_space: spaces.Space,
    ) -> None:
        """Take missions that have not begun, and whether an agent is a robot or a team."""
        self.batches = list(batches)
        self.agent: Agent = agent
        self.render_mode = None
        sizes = [batch.num_missions * self._per_mission(batch) for batch in batches]
        ends = np.cumsum(sizes).tolist()
        self._envs = [slice(end - size, end) for end, size in zip(ends, sizes, strict=True)]
        super().__init__(sum(sizes), observation_space, action_space)
        self.seed(None)

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions; `step_wait` plays them."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Fly one window; after the last one, others begin. Bad actions are a ValueError."""
        reward = np.zeros(self.num_envs, np.float32)
        done = np.zeros(self.num_envs, np.bool_)
        recipients = self._recipients()  # of all batches: if one is bad, none moves
        for n, (batch, envs) in enumerate(zip(self.batches, self._envs, strict=True)):
            paid = self._fly(n, recipients[n])
            reward[envs] = paid[:, : self._per_mission(batch)].ravel() / self.reward_unit
            done[envs] = batch.is_over
        # Of this window: a restart, below, forgets them.
        self.costs = [batch.costs for batch in self.batches]
        seen = self._observe()
        infos = self._infos()
        if done.any():
            for env in np.flatnonzero(done & self._is_truncated()):
                last = {name: rows[env] for name, rows in seen.items()}
                infos[env] |= {"terminal_observation": last, "TimeLimit.truncated": True}
            for n in np.flatnonzero([batch.is_over for batch in self.batches]).tolist():
                self._begin(n)
            seen = self._observe()
            self.reset_infos = self._infos()
        return seen, reward, done, infos

    def env_method(
        self, method_name: str, *_: object, indices: VecEnvIndices = None, **__: object
    ) -> list[Any]:
        """Raise AttributeError: environments have no methods of their own."""
        del indices
        raise AttributeError(f"no environment has its own {method_name}")

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return the attribute of this object, once per environment."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, *_: object, **__: object) -> None:
        """Raise AttributeError: environments have no attributes of their own."""
        raise AttributeError(f"no environment has its own {attr_name}")

    def env_is_wrapped(self, wrapper_class: type, indices: VecEnvIndices = None) -> list[bool]:
        """Return False for each environment: none is wrapped."""
        del wrapper_class
        return [False for _ in self._get_indices(indices)]

    def close(self) -> None:
        """Do nothing: there is nothing to release."""

    def _recipients(self) -> list[Int[np.ndarray, "B N"]]:
        """Return the actions batch by batch; raise ValueError for any that is no robot."""
        shape = (self.num_envs, *(self.action_space.shape or ()))
        given = as_array("actions", self._actions)
        if given.shape not in (shape, (*shape, 1)):  # some wrap each number
            raise ValueError(f"actions must have shape {shape}, not {given.shape}")
        recipients: list[np.ndarray] = []
        for batch, envs in zip(self.batches, self._envs, strict=True):
            # Teams smaller than the largest one are padded with columns of silence.
            rows = given[envs].reshape(batch.num_missions, -1)[:, : batch.mission.num_robots]
            recipients.append(checked_robots("action", rows, batch.shape))
        return recipients

    def _per_mission(self, batch: MissionBatch) -> int:
        return batch.mission.num_robots if self.agent == "robot" else 1

    def _fly(self, n: int, recipient: Int[np.ndarray, "B N"]) -> Float[np.ndarray, "B N"]:
        """Fly one window of batch n; return the robots' rewards."""
        return self.batches[n].step(recipient)

    @abstractmethod
    def _begin(self, n: int) -> None:
        """Begin other missions of batch n."""

    @abstractmethod
    def _is_truncated(self) -> Bool[np.ndarray, "E"]:
        """Return where a mission's end is a cut in time."""

    @abstractmethod
    def _infos(self) -> list[dict[str, Any]]:
        """Return what is said of the window flown, by environment."""

    @abstractmethod
    def _observe(self) -> Observation:
        """Return what agents see, by environment."""


class SwarmVecEnv(BatchVecEnv):
    """Missions that users train on: they choose the seeds, and all missions are flown to the end.

    Policies may ask for the `action_masks` of sb3-contrib.
    """

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Let the next reset begin the missions of seeds from this one on; return each one's."""
        missions: list[MissionBatch] = []  # the batch of each mission
        for batch in self.batches:
            missions += [batch] * batch.num_missions
        self._given = seeds_from(seed, len(missions))
        self._rngs = [seeding.np_random(each)[0] for each in self._given]
        per_mission = [self._per_mission(batch) for batch in missions]
        return np.repeat(np.array(self._given, dtype=object), per_mission).tolist()

    def reset(self) -> Observation:
        """Begin the missions of the seeds given, and else others; their seeds are in infos."""
        for n in range(len(self.batches)):
            self._begin(n)
        self.reset_infos = self._infos()
        return self._observe()

    def action_masks(self) -> Bool[np.ndarray, "E A"]:
        """Actions that may help: a recipient each, or a team's, robot by robot."""
        return self._observe()["action_mask"].reshape(self.num_envs, -1).astype(np.bool_)

    def env_method(
        self, method_name: str, *_: object, indices: VecEnvIndices = None, **__: object
    ) -> list[Any]:
        """Call `action_masks`, the one method of environments; raises AttributeError for others."""
        if method_name != "action_masks":
            return super().env_method(method_name, indices=indices)
        masks = self.action_masks()
        return [masks[env] for env in self._get_indices(indices)]

    def _begin(self, n: int) -> None:
        """Begin other missions of batch n: of the seeds given, or else drawn from them."""
        first = sum(batch.num_missions for batch in self.batches[:n])
        mine = slice(first, first + self.batches[n].num_missions)
        given = zip(self._given[mine], self._rngs[mine], strict=True)
        self.batches[n].restart([seed_or_next(seed, rng) for seed, rng in given])
        self._given[mine] = [None] * self.batches[n].num_missions

    def _is_truncated(self) -> Bool[np.ndarray, "E"]:
        """Return where a mission's end is a cut in time; as Gymnasium has it, everywhere."""
        return np.ones(self.num_envs, dtype=np.bool_)

    def _infos(self) -> list[dict[str, Any]]:
        infos: list[dict[str, Any]] = []
        for batch in self.batches:
            shown = {name: values.tolist() for name, values in batch.infos().items()}
            for b in range(batch.num_missions):
                info = {name: values[b] for name, values in shown.items()}
                infos += [info.copy() for _ in range(self._per_mission(batch))]
        return infos

    def _observe(self) -> Observation:
        seen = [batch.observation for batch in self.batches]
        together: Observation = {}
        for name in seen[0]:
            rows = np.concatenate([each[name] for each in seen])
            if self.agent == "robot":
                rows = rows.reshape(-1, *rows.shape[2:])
            together[name] = rows
        return together
