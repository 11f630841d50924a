"""stable-baselines3's interface: B missions as one `VecEnv`, for its algorithms, sb3-contrib's too.

An environment is one robot, or one team. All missions begin and end together.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Any, Unpack

import numpy as np
import stable_baselines3
from gymnasium import spaces
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.torch_layers import CombinedExtractor
from stable_baselines3.common.vec_env import VecNormalize, unwrap_vec_wrapper
from torch import nn

from swarm_mj.envs.flown_model import OF_OTHERS, OF_SENSORS, Flown, is_masked, missions_of
from swarm_mj.envs.held_out_callback import HeldOutCallback
from swarm_mj.envs.mission_batch import MissionBatch
from swarm_mj.envs.options import (
    BatchOptions,
    make_batch,
    make_team_batch,
    robot_spaces,
    team_spaces,
)
from swarm_mj.envs.vec_env import AGENTS, SwarmVecEnv
from swarm_mj.mission import Mission
from swarm_mj.policies.policy_config import Activation, MlpConfig, MlpShape
from swarm_mj.policies.stored import save_weights
from swarm_mj.system.arguments import checked_choice
from swarm_mj.system.packages import commit, version

__all__ = ["Flown", "HeldOutCallback", "make_vec_env", "save_policy"]

# Of networks that can be stored as policies.
ACTIVATIONS: dict[Activation, type[nn.Module]] = {"tanh": nn.Tanh, "relu": nn.ReLU}
# The way out for models that cannot be stored.
INSTEAD = "fly the model itself: swarm_mj.envs.sb3.Flown(model)"


def make_vec_env(
    mission: Mission | str = "flocking",
    num_missions: int = 1,
    *,
    agent: str = "robot",
    seed: int | None = None,
    **options: Unpack[BatchOptions],
) -> SwarmVecEnv:
    """Return B missions for stable-baselines3, with `action_masks()` for `MaskablePPO`.

    Args:
        mission: The mission, or its task.
        num_missions: B.
        agent: What an environment is: a "robot", so that B N environments share one network that
            sees what one robot knows; or a "team", which decides for all at once.
        seed: Of the first mission; the others count on from it. Later missions are drawn from
            these; None draws the first ones, too. A model with a `seed` of its own begins with
            that mission instead: stable-baselines3 seeds its environment with it, also in
            `load(path, env=env)`. So load a model without `env` to evaluate it, or call
            `env.seed(3000)` afterwards.
        **options: As of `make_batch`: the reward, the features, and any field of `Mission`.

    Returns:
        The environments: B N if an agent is a robot, or B if it is a team.

    Raises:
        ValueError: If a value is unknown or out of range, or the reward "credit", which is each
            robot's own, is to pay a team.
        TypeError: If an option is unknown.
        gymnasium.error.Error: If the seed is not an integer of 0 or more.

    Example:
        >>> model = PPO("MultiInputPolicy", make_vec_env("flocking", 4, num_robots=10, seed=1))
    """
    chosen = checked_choice("agent", agent, AGENTS)
    for name in {"n_envs", "num_envs"} & options.keys():
        raise TypeError(f"make_vec_env has no {name!r}; did you mean num_missions?")
    if "render_mode" in options:
        raise TypeError(
            "make_vec_env has no 'render_mode', as it draws nothing; see a model by "
            "swarm_mj.fly(..., policy=swarm_mj.envs.sb3.Flown(model)), or draw the environment "
            'gymnasium.make(..., render_mode="rgb_array")'
        )
    if chosen == "robot":
        batch = make_batch(mission, num_missions, **options)
        observation_space, action_space = robot_spaces(batch)
    else:
        batch = make_team_batch(mission, num_missions, **options)
        observation_space, action_space = team_spaces(batch)
    env = SwarmVecEnv([batch], chosen, observation_space, action_space)
    env.seed(seed)
    return env


def save_policy(model: BaseAlgorithm, path: Path | str) -> Path:
    """Store a trained actor as a policy that `swarm-mj fly --policy FILE` flies; return the file.

    It holds the network's weights, no code and no pickle; the model itself is not kept.

    Args:
        model: PPO, A2C or MaskablePPO with its own "MultiInputPolicy", trained on an environment
            of `make_vec_env` whose agents are robots; `VecNormalize` may have normalised its
            rewards. A model that was loaded needs that environment again, `PPO.load(path,
            env=env)`, which then flies the missions of the model's seed: evaluate on another one.
        path: The file, which is replaced if it exists; `.safetensors` is appended unless it ends
            so.

    Returns:
        The path of the file, with its ending.

    Raises:
        ValueError: If the model is another, or too large for a policy's file. `Flown` flies models
            with a features extractor of your own, DQN, and those of `VecNormalize`.
        OSError: If the file cannot be written.

    Example:
        >>> save_policy(model.learn(100_000), "mine.safetensors")
    """
    batch = _trained_on(model)
    layers = _actor(model)
    linear = [each for each in layers if isinstance(each, nn.Linear)]
    weights: dict[str, np.ndarray] = {}
    for n, layer in enumerate(linear):
        for name, tensor in layer.named_parameters():
            weights[f"{n}.{name}"] = tensor.detach().cpu().numpy().copy()
    network = MlpShape(
        num_robots=batch.mission.num_robots,
        features=batch.features,
        num_features=batch.num_features,
        hidden=tuple(layer.out_features for layer in linear[:-1]),
        activation=_activation_of(layers),
        obeys_mask=is_masked(model),
    )
    training = {
        "algorithm": f"{type(model).__name__} of stable-baselines3 {stable_baselines3.__version__}",
        "timesteps": model.num_timesteps,
        "reward": batch.reward,
        "mission": asdict(batch.mission),
    }
    config = MlpConfig(
        network=network, training=training, evaluation={}, commit=commit(), version=version()
    )
    return save_weights(Path(path), weights, config)


def _trained_on(model: BaseAlgorithm) -> MissionBatch:
    """Return a model's missions; raises ValueError if no policy can be made of it."""
    env = model.get_env()
    kind = type(model).__name__
    if not hasattr(model.policy, "action_dist"):
        raise ValueError(
            f"a policy is made of an actor that draws recipients, and {kind} has none; train PPO, "
            f"A2C or MaskablePPO, or {INSTEAD}"
        )
    if env is None:
        raise ValueError(
            f"the model has no environment; load the model with it: {kind}.load(path, env=env)"
        )
    batch = missions_of(model)
    if batch is None or not isinstance(model.action_space, spaces.Discrete):
        raise ValueError(OF_OTHERS)
    if batch.with_parents:
        raise ValueError(
            "a policy of this kind sees no parents; train without with_parents=True, or " + INSTEAD
        )
    if batch.with_sensors:
        raise ValueError(OF_SENSORS)
    normalised = unwrap_vec_wrapper(env, VecNormalize)
    if normalised is not None and normalised.norm_obs:
        raise ValueError(
            "a policy cannot be made of a model whose observations VecNormalize normalises, as it "
            "would need their averages; they are normalised already, so train with "
            f"VecNormalize(env, norm_obs=False), or {INSTEAD}"
        )
    return batch


def _actor(model: BaseAlgorithm) -> list[nn.Module]:
    """Return the layers that lead to a decision; raises ValueError if they are not plain ones."""
    policy: Any = model.policy
    own = ("mlp_extractor.policy_net.", "action_net.", "mlp_extractor.value_net.", "value_net.")
    is_plain = type(getattr(policy, "features_extractor", None)) is CombinedExtractor
    others = [name for name, _ in policy.named_parameters() if not name.startswith(own)]
    if not is_plain or others:
        raise ValueError(
            f'a policy is made of the actor of "MultiInputPolicy" alone, not of '
            f"{type(policy).__name__}'s {others[0] if others else 'own features extractor'}; "
            f"train without it, or {INSTEAD}"
        )
    return [*policy.mlp_extractor.policy_net, policy.action_net]


def _activation_of(layers: list[nn.Module]) -> Activation:
    """Return the activation between layers; raises ValueError if none is known of them all."""
    between = {type(each) for each in layers} - {nn.Linear}
    names: dict[type[nn.Module], Activation] = {each: name for name, each in ACTIVATIONS.items()}
    if len(between) > 1 or not between <= set(names):
        raise ValueError(
            f"a policy's activation must be one of {', '.join(ACTIVATIONS)}, not "
            f"{' and '.join(sorted(kind.__name__ for kind in between))}"
        )
    return names[between.pop()] if between else "tanh"
