"""Checkpoints: all that a run needs to go on as if it had never stopped.

One file of tensors, numbers and strings. It is read without running code from it, and it is whole
or not there.
"""

import io
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from swarm_mj.learning.actor_critic import GnnActorCritic
from swarm_mj.learning.checkpoint_state import check_state
from swarm_mj.learning.choice import NUM_BEST
from swarm_mj.learning.graph_vec_env import ActionHistory, env_of
from swarm_mj.learning.run_folder import Progress
from swarm_mj.learning.settings import Training
from swarm_mj.learning.torch_file import read_torch
from swarm_mj.policies.gnn.network import AggregationGnn
from swarm_mj.system.atomic import write_bytes
from swarm_mj.system.reading import read_json

CHECKPOINT_VERSION = 3
SPARE_BYTES = 100_000_000  # the curve's, and what else does not depend on the settings


Networks = dict[int, AggregationGnn]  # of policies that may be kept, by their decisions


def save(
    path: Path,
    training: Training,
    model: PPO,
    rng: np.random.Generator,
    progress: Progress,
    networks: Networks,
) -> None:
    """Write a checkpoint; call it between rollouts. `rng` draws the missions' seeds.

    Raises:
        OSError: The file cannot be written.
    """
    name, keys, *rest = np.random.get_state()  # noqa: NPY002 - PPO shuffles minibatches with it
    state: dict[str, Any] = {
        "version": CHECKPOINT_VERSION,
        "training": json.dumps(asdict(training)),
        "parameters": model.get_parameters(),  # of the networks and the optimiser
        "num_timesteps": model.num_timesteps,
        "num_updates": model._n_updates,
        "episode_starts": torch.tensor(model._last_episode_starts),
        "histories": [
            vars(history)
            | {"recipients": torch.tensor(np.array(history.recipients, dtype=np.int16))}
            for history in env_of(model).histories
        ],
        "reward_normaliser": _normaliser_state(model),
        "torch_rng": torch.get_rng_state(),
        "cuda_rng": torch.cuda.get_rng_state(model.device) if model.device.type == "cuda" else None,
        "numpy_rng": [name, np.asarray(keys).tolist(), *rest],
        "seeds_rng": rng.bit_generator.state,
        "progress": asdict(progress),
        "candidates": {at: network.state_dict() for at, network in networks.items()},
    }
    content = io.BytesIO()
    torch.save(state, content)
    write_bytes(path, content.getbuffer())


def load(
    path: Path, training: Training, model: PPO, rng: np.random.Generator
) -> tuple[Progress, Networks]:
    """Put a model and its missions, made of these settings, back to where a checkpoint was made.

    Returns where the run stands, and the networks of its candidates.

    Raises:
        ValueError: The file is damaged, foreign, of a newer version or of other settings.
        OSError: The file cannot be read.
    """
    state = _read(path, _most_bytes(model))
    try:
        if read_json(state["training"], Training) != training:
            raise ValueError("it was made with other settings than the run's")
        progress = check_state(state, model)
        networks = _networks(state, model)
        _restore(state, model, rng)
    except Exception as error:  # generators of random numbers take states as they please
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(
            f"checkpoint {path} is damaged, or another run's ({reason:.200}); begin a new run with "
            "another --out"
        ) from error
    return progress, networks


def acting_network(model: PPO) -> AggregationGnn:
    """Return a copy of the network that acts."""
    assert isinstance(model.policy, GnnActorCritic)
    return model.policy.acting_network()


def _networks(state: dict[str, Any], model: PPO) -> Networks:
    """Return the candidates'."""
    networks = {}
    for at, weights in state["candidates"].items():
        networks[at] = acting_network(model)
        networks[at].load_state_dict(weights)
    return networks


def _most_bytes(model: PPO) -> int:
    """What a checkpoint of a model takes, and much more for its curve."""
    weights = sum(weight.nbytes for weight in model.policy.parameters())
    weights *= 3 + NUM_BEST + 1  # and Adam's two, and the candidates'
    batches = env_of(model).batches
    decisions = sum(b.mission.num_windows * b.num_missions * b.mission.num_robots for b in batches)
    return 2 * (weights + np.dtype(np.int16).itemsize * decisions) + SPARE_BYTES


def _read(path: Path, most_bytes: int) -> dict[str, Any]:
    """Raise ValueError for what is no whole checkpoint of this version."""
    state: Any = read_torch(path, most_bytes)
    version = state.get("version") if isinstance(state, dict) else None
    if not isinstance(version, int):
        raise ValueError(f"{path} is no checkpoint of swarm-mj train")
    if version != CHECKPOINT_VERSION:
        raise ValueError(
            f"checkpoint {path} has version {version!r:.40}, and this swarm_mj reads "
            f"{CHECKPOINT_VERSION}; resume with the version that wrote it"
        )
    return state


def _restore(state: dict[str, Any], model: PPO, rng: np.random.Generator) -> None:
    model.set_parameters(state["parameters"], device=model.device)
    model.num_timesteps = state["num_timesteps"]
    model._n_updates = state["num_updates"]
    env = env_of(model)
    model._last_obs = env.replay(
        [
            ActionHistory(**history | {"recipients": [*history["recipients"].numpy()]})
            for history in state["histories"]
        ]
    )
    model._last_episode_starts = state["episode_starts"].numpy()
    _restore_normaliser(model, state["reward_normaliser"])
    torch.set_rng_state(state["torch_rng"])
    if state["cuda_rng"] is not None and model.device.type == "cuda":
        torch.cuda.set_rng_state(state["cuda_rng"], model.device)
    np.random.set_state(tuple(state["numpy_rng"]))  # noqa: NPY002 - as in `save`
    rng.bit_generator.state = state["seeds_rng"]


def _normaliser_state(model: PPO) -> dict[str, Any] | None:
    """Return the running variance of returns, if rewards are normalised."""
    env = model.get_env()
    if not isinstance(env, VecNormalize):
        return None
    running = {name: float(value) for name, value in vars(env.ret_rms).items()}
    return {"running": running, "returns": torch.tensor(env.returns)}


def _restore_normaliser(model: PPO, state: dict[str, Any] | None) -> None:
    env = model.get_env()
    if isinstance(env, VecNormalize) and state is not None:
        for name, value in state["running"].items():
            setattr(env.ret_rms, name, value)
        env.returns = state["returns"].numpy()
