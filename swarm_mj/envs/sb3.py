"""The stable-baselines3 face: B missions behind one `VecEnv`, for its algorithms and sb3-contrib's.

An environment is one robot, or one team. All missions begin and end together.
"""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import stable_baselines3
from gymnasium.utils import seeding
from jaxtyping import Bool
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.torch_layers import CombinedExtractor
from stable_baselines3.common.vec_env import VecEnv, VecNormalize, unwrap_vec_wrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvStepReturn
from torch import nn

from swarm_mj.envs.gymnasium import check_paid_together
from swarm_mj.envs.spaces import robot_spaces, team_spaces
from swarm_mj.envs.team import Observation, Team, next_seed
from swarm_mj.mission import Mission
from swarm_mj.policies.mlp import MlpShape
from swarm_mj.policies.policy_config import MlpConfig
from swarm_mj.policies.stored import save_weights
from swarm_mj.system.provenance import commit, version

AGENTS = ("robot", "team")  # what an environment is
ACTIVATIONS = {"tanh": nn.Tanh, "relu": nn.ReLU}  # of networks that can be stored as policies


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
            these; None draws the first ones, too. A model with a `seed` of its own begins with
            that mission instead: stable-baselines3 seeds its environment with it.
        **options: As of `Team`: the reward, the features, and any field of `Mission`.

    Raises:
        ValueError: A value is unknown or out of range.
        TypeError: An option is unknown.
    """
    if agent not in AGENTS:
        raise ValueError(f"agent must be one of {', '.join(AGENTS)}, not {agent!r}")
    for name in {"n_envs", "num_envs"} & options.keys():
        raise TypeError(f"make_vec_env has no {name!r}; did you mean num_missions?")
    env = SwarmVecEnv(Team(mission, num_missions, **options), agent)
    env.seed(seed)
    return env


class SwarmVecEnv(VecEnv):
    """See `make_vec_env`; environments run mission by mission and, if a robot is one, by robot."""

    def __init__(self, team: Team, agent: str) -> None:
        """Take missions that have not begun."""
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
        self.reset_infos = self._infos()
        return self._observations()

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions; `step_wait` plays them."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """One window of all missions; after the last one, others begin.

        Raises:
            ValueError: A recipient is no robot; nothing has moved.
        """
        shape = (self.team.num_missions, self.team.mission.num_robots)
        reward = self.team.step(self._actions.reshape(shape))[:, : self._per_mission].ravel()
        is_over = self.team.is_over
        infos = self._infos()
        seen = self._observations()
        if is_over:
            for env, info in enumerate(infos):
                info["terminal_observation"] = {name: each[env] for name, each in seen.items()}
                info["TimeLimit.truncated"] = True
            seen = self.reset()
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
        """Return the attribute of this object, once per environment."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, *_: object, **__: object) -> None:
        """Environments have no attributes of their own; raises AttributeError."""
        raise AttributeError(f"no environment has its own {attr_name}")

    def env_is_wrapped(self, wrapper_class: type, indices: VecEnvIndices = None) -> list[bool]:
        """No environment is wrapped."""
        del wrapper_class
        return [False for _ in self._get_indices(indices)]

    def close(self) -> None:
        """There is nothing to release."""

    def _infos(self) -> list[dict[str, Any]]:
        """Each environment's mission's seed, and what the window cost it."""
        infos = self.team.infos().items()
        return [
            {name: values[env // self._per_mission].item() for name, values in infos}
            for env in range(self.num_envs)
        ]

    def _observations(self) -> Observation:
        """What all environments see."""
        seen = self.team.observation
        if self.agent == "team":
            return seen
        return {name: values.reshape(-1, *values.shape[2:]) for name, values in seen.items()}


def save_policy(model: BaseAlgorithm, path: Path | str) -> Path:
    """Store a trained actor as a policy that `swarm-mj fly --policy FILE` flies.

    The file holds the network's weights, no code and no pickle; the model itself is not kept.

    Args:
        model: PPO, A2C or MaskablePPO with its own "MultiInputPolicy", trained on an environment
            of `make_vec_env` whose agents are robots; `VecNormalize` may have normalised its
            rewards. A model that was loaded needs it again: `PPO.load(path, env=env)`.
        path: Where; `.safetensors` is appended unless it ends so. A file there is replaced.

    Returns:
        The file.

    Raises:
        ValueError: The model is another.
        OSError: The file cannot be written.
    """
    team = _trained_on(model)
    layers = _actor(model)
    activation, hidden = _shape_of(layers)
    weights = {
        f"{n}.{name}": tensor.detach().cpu().numpy().copy()
        for n, layer in enumerate(each for each in layers if isinstance(each, nn.Linear))
        for name, tensor in layer.named_parameters()
    }
    network = MlpShape(
        num_robots=team.mission.num_robots,
        features=team.features,
        num_features=team.num_features,
        hidden=hidden,
        activation=activation,
        obeys_mask=hasattr(model.policy.action_dist, "apply_masking"),
    )
    training = {
        "algorithm": f"{type(model).__name__} of stable-baselines3 {stable_baselines3.__version__}",
        "timesteps": model.num_timesteps,
        "reward": team.reward,
        **{f"mission.{name}": value for name, value in asdict(team.mission).items()},
    }
    config = MlpConfig(
        network=network, training=training, evaluation={}, commit=commit(), version=version()
    )
    return save_weights(Path(path), weights, config)


def _trained_on(model: BaseAlgorithm) -> Team:
    """The missions that a model was trained on; raises ValueError if a policy cannot be made."""
    env, kind = model.get_env(), type(model).__name__
    if not hasattr(model.policy, "action_dist"):
        raise ValueError(
            f"a policy is made of an actor that draws recipients, and {kind} has none; train PPO, "
            "A2C or MaskablePPO"
        )
    if env is None:
        raise ValueError(
            f"the model has no environment; load the model with it: {kind}.load(path, env=env)"
        )
    inner = env.unwrapped
    if not isinstance(inner, SwarmVecEnv):
        raise ValueError(
            "a policy is made of a model that decides for one robot, and this one was trained on "
            "another environment; train on swarm_mj.envs.sb3.make_vec_env"
        )
    if inner.agent != "robot":
        raise ValueError(
            'a policy decides for one robot, and agent="team" for all at once; train on '
            'make_vec_env(..., agent="robot")'
        )
    if inner.team.with_parents:
        raise ValueError("a policy of this kind sees no parents; train without with_parents=True")
    normalised = unwrap_vec_wrapper(env, VecNormalize)
    if normalised is not None and normalised.norm_obs:
        raise ValueError(
            "a policy cannot be made of a model whose observations VecNormalize normalises, as it "
            "would need their averages; they are normalised already, so train with "
            "VecNormalize(env, norm_obs=False)"
        )
    return inner.team


def _actor(model: BaseAlgorithm) -> list[nn.Module]:
    """Return the layers that lead to a decision; raises ValueError if they are not plain ones."""
    policy: Any = model.policy
    own = ("mlp_extractor.policy_net.", "action_net.", "mlp_extractor.value_net.", "value_net.")
    is_plain = type(getattr(policy, "features_extractor", None)) is CombinedExtractor
    others = [name for name, _ in policy.named_parameters() if not name.startswith(own)]
    if not is_plain or others:
        raise ValueError(
            f'a policy is made of the actor of "MultiInputPolicy" alone, not of '
            f"{type(policy).__name__}'s {others[0] if others else 'own features extractor'}"
        )
    return [*policy.mlp_extractor.policy_net, policy.action_net]


def _shape_of(layers: list[nn.Module]) -> tuple[Any, tuple[int, ...]]:
    """Return the activation between layers, and the widths of all but the last."""
    *hidden, _ = [each.out_features for each in layers if isinstance(each, nn.Linear)]
    between = {type(each) for each in layers} - {nn.Linear}
    names = {kind: name for name, kind in ACTIVATIONS.items()}
    if len(between) > 1 or not between <= set(names):
        raise ValueError(
            f"a policy's activation must be one of {', '.join(ACTIVATIONS)}, not "
            f"{' and '.join(sorted(kind.__name__ for kind in between))}"
        )
    return names[between.pop()] if between else "tanh", tuple(hidden)
