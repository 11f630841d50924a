"""A model of stable-baselines3 as a policy, which flies wherever policies do."""

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
import torch
from gymnasium import spaces
from jaxtyping import Float
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecNormalize

from swarm_mj.envs.mission_batch import MissionBatch, Observation
from swarm_mj.envs.vec_env import SwarmVecEnv
from swarm_mj.mission import Mission
from swarm_mj.policies.gnn.decisions import single_thread
from swarm_mj.policies.gnn.feature_sets import (
    is_own_set,
    load_features,
    make_extractor,
    num_features,
)
from swarm_mj.policies.gnn.graphs import Graphs
from swarm_mj.policies.learned import LearnedPolicy
from swarm_mj.policies.policy_config import Tensors
from swarm_mj.system.arguments import check_kind

USUAL_FEATURES = "extended"  # as of `make_batch`
OF_OTHERS = (
    "a policy is made of a model that decides for one robot, and this one was trained on "
    'another environment; train on swarm_mj.envs.sb3.make_vec_env(..., agent="robot")'
)
OF_SENSORS = (
    "a policy decides by what robots have heard, and this model sees sensors, too; fly it in its "
    "environment, or train without with_sensors=True"
)


class Flown(LearnedPolicy):
    """A model of stable-baselines3 as a policy: every robot runs it on its own view.

    Models fly that `save_policy` cannot store: those with a features extractor of your own, DQN,
    and those whose observations `VecNormalize` has normalised. The model is live: if it learns on,
    the policy changes, too. The mission's own generators draw, so the same seed is the same
    mission, whatever flies beside it.

    Attributes:
        mission: What it was made for; `fly(policy.mission, policy=policy)` flies it.

    Example:
        >>> policy = Flown(model.learn(100_000))
        >>> run = swarm_mj.fly(policy.mission, policy=policy, seed=3000)
    """

    def __init__(
        self,
        model: BaseAlgorithm,
        mission: Mission | None = None,
        *,
        features: str | None = None,
        normalize: VecNormalize | None = None,
        is_deterministic: bool = False,
    ) -> None:
        """Take a model that was trained on robots.

        Args:
            model: Any but a recurrent one, trained on `make_vec_env` whose agents are robots. DQN
                takes its best recipient; the others draw.
            mission: What it flies, whose area, duration and range normalise what robots see. None
                is that of the model's environment.
            features: Those that it was trained on. None is those of the model's environment or,
                if it has none, "extended".
            normalize: What normalised its observations. None is that of the model's environment.
            is_deterministic: Whether robots take the most probable recipient, not a draw.

        Raises:
            ValueError: If the model was trained on another environment, team size or features, is
                recurrent, or if a model without an environment is given no mission.
            TypeError: If the model is a file's name, or the mission a task's.
        """
        check_kind("model", model, BaseAlgorithm, 'PPO.load("best.zip")')
        if mission is not None:
            check_kind("mission", mission, Mission, 'paper("flocking")')
        self._num_robots, self._num_features = _num_robots_and_features(model)
        _check_decides(model)
        batch = missions_of(model)
        if mission is None:
            if batch is None:
                raise ValueError(
                    "the model has no environment that says what it flies; give the mission: "
                    "Flown(model, mission)"
                )
            mission = batch.mission
        self.mission = mission
        self._check_size(mission.num_robots)
        if features is None:
            features = USUAL_FEATURES if batch is None else batch.features
        if is_own_set(features):
            load_features(features)
        if num_features(features) != self._num_features:
            raise ValueError(
                f"the model sees {self._num_features} numbers of each robot, and the features "
                f'{features} are {num_features(features)}; name its own: Flown(..., features="...")'
            )
        extractor = make_extractor(features, mission)
        super().__init__(
            extractor,
            is_deterministic=is_deterministic or _is_greedy(model),
            own_features=features if is_own_set(features) else "",
        )
        self._model = model
        self._normalize = model.get_vec_normalize_env() if normalize is None else normalize
        self.uses = f"{extractor.uses}, by a network that {type(model).__name__} trained"

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Prepare as any learned policy; raises ValueError for another size of team."""
        self._check_size(num_robots)
        super().start(num_robots, rngs)
        self._model.policy.set_training_mode(False)

    def logits(self, graphs: Graphs) -> Float[np.ndarray, "R N"]:
        """Return each robot's logits over recipients.

        Mission by mission: one batch of all would round otherwise for other numbers of missions, so
        a mission would depend on those flown with it.
        """
        num_rows, num_robots = graphs.may_address.shape
        logits = np.empty((num_rows, num_robots))
        with single_thread(), torch.no_grad():
            for first in range(0, num_rows, num_robots):
                rows = slice(first, first + num_robots)
                logits[rows] = self._logits_of_mission(self._seen(graphs, rows))
        return logits

    def identity(self) -> tuple[object, Tensors]:
        """Return what the model is made of and sees, and its weights and averages now."""
        policy = self._model.policy
        weights: dict[str, np.ndarray] = {}
        for name, tensor in policy.state_dict().items():
            weights[name] = tensor.detach().cpu().contiguous().numpy()
        for name, average in self._averages().items():
            weights[f"{name} mean"] = np.asarray(average.mean)
            weights[f"{name} variance"] = np.asarray(average.var)
        return (type(self._model).__name__, str(policy), self._extractor.names), weights

    def _averages(self) -> Mapping[str, Any]:
        """Return the averages of what is normalised, by the observation's name."""
        if self._normalize is None or not self._normalize.norm_obs:
            return {}
        return cast("Mapping[str, Any]", self._normalize.obs_rms)

    def _seen(self, graphs: Graphs, rows: slice) -> Observation:
        """Return what one mission's robots see, as the environment shows it."""
        may_address = graphs.may_address[rows] | np.eye(self._num_robots, dtype=np.bool_)
        seen = {
            "action_mask": may_address.view(np.int8),
            "observation": graphs.node[rows],
            "parent": graphs.parent[rows].astype(np.int32),
        }
        known = cast("spaces.Dict", self._model.observation_space).spaces
        return {name: array for name, array in seen.items() if name in known}

    def _logits_of_mission(self, seen: Observation) -> Float[np.ndarray, "N N"]:
        policy: Any = self._model.policy  # which has more than its base class says
        masks = seen["action_mask"].astype(np.bool_)  # normalised ones are none
        if self._normalize is not None:
            seen = cast("Observation", self._normalize.normalize_obs(seen))
        tensors, _ = policy.obs_to_tensor(seen)
        if _is_greedy(self._model):
            return policy.q_net(tensors).cpu().numpy()
        obeys_mask = {"action_masks": masks} if is_masked(self._model) else {}
        return policy.get_distribution(tensors, **obeys_mask).distribution.logits.cpu().numpy()

    def _check_size(self, num_robots: int) -> None:
        if num_robots != self._num_robots:
            raise ValueError(
                f"the model flies teams of {self._num_robots} robots, for which it was trained, "
                f"not {num_robots}; choose num_robots={self._num_robots}"
            )


def missions_of(model: BaseAlgorithm) -> MissionBatch | None:
    """Return the missions that a model's environment flies; None if it has no such environment."""
    env = model.get_env()
    missions = env.unwrapped if env is not None else None
    return missions.batches[0] if isinstance(missions, SwarmVecEnv) else None


def is_masked(model: BaseAlgorithm) -> bool:
    """Return whether a model draws among the recipients of the mask only, as MaskablePPO does."""
    return hasattr(getattr(model.policy, "action_dist", None), "apply_masking")


def _is_greedy(model: BaseAlgorithm) -> bool:
    """Return whether a model has values of recipients in place of a distribution, as DQN has."""
    return hasattr(model.policy, "q_net")


def _check_decides(model: BaseAlgorithm) -> None:
    """Raise ValueError for a model of which robots' decisions cannot be had view by view."""
    kind = type(model).__name__
    if hasattr(model.policy, "lstm_actor"):
        raise ValueError(
            f"{kind} remembers what it saw, and so cannot fly; train PPO, A2C, MaskablePPO or DQN, "
            "or a network with a memory by `swarm-mj train --network`"
        )
    if not (_is_greedy(model) or hasattr(model.policy, "get_distribution")):
        raise ValueError(
            f"{kind} has neither a distribution nor values of recipients; train PPO, A2C, "
            "MaskablePPO or DQN"
        )


def _num_robots_and_features(model: BaseAlgorithm) -> tuple[int, int]:
    """Return N and F of a model's views; raises ValueError if they are not one robot's."""
    seen: Mapping[str, spaces.Space[Any]] = {}
    if isinstance(model.observation_space, spaces.Dict):
        seen = model.observation_space.spaces
    if "sensors" in seen:
        raise ValueError(OF_SENSORS)
    shape = seen["observation"].shape if "observation" in seen else None
    is_ours = seen.keys() <= {"action_mask", "observation", "parent"}
    if not is_ours or shape is None or len(shape) != 2:
        raise ValueError(OF_OTHERS)
    num_robots, width = shape
    if not isinstance(model.action_space, spaces.Discrete) or model.action_space.n != num_robots:
        raise ValueError(OF_OTHERS)
    return num_robots, width
