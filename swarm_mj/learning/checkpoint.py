"""Checkpoints: all that a run needs to go on as if it had never stopped.

One file of tensors, numbers and strings. It is read without running code from it, and it is whole
or not there. Nothing of a run changes before every shape, kind and range in it has been checked.
"""

import io
import json
import math
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch
from msgspec import Meta
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize
from torch import Tensor

from swarm_mj.learning.graph_vec_env import env_of
from swarm_mj.learning.ppo import policy_of
from swarm_mj.learning.selection import NUM_BEST, Progress, candidates
from swarm_mj.learning.settings import Training
from swarm_mj.policies.gnn.network import AggregationGnn
from swarm_mj.system.reading import read_file, read_json, read_plain
from swarm_mj.system.writing import write_bytes

CHECKPOINT_VERSION = 5
SPARE_BYTES = 100_000_000  # the curve's, and what else does not depend on the settings
MOMENTS = ("mean", "var", "count")  # of `VecNormalize`'s returns
IN_A_ROW = (  # of the learning curve
    *("decisions", "minutes", "aoi", "aoi_steady", "velocity_variance", "objective"),
    *("packets_per_window", "delivery_ratio"),
)

Networks = dict[int, AggregationGnn]  # of policies that may be kept, by their decisions


@dataclass(frozen=True, kw_only=True)
class _Plain:
    """The part of a checkpoint that is neither tensors nor a library's own state."""

    progress: Progress  # how often PPO has learned follows from its decisions
    seeds: list[list[int]]  # of the missions under way, by batch; replaying checks their range
    last_windows: list[int]  # when they end, by batch
    # NumPy checks all of it but the place in the key, and reads the word there unchecked.
    numpy_rng: tuple[str, list[int], Annotated[int, Meta(ge=0, le=624)], int, float]


def save(
    path: Path, training: Training, model: PPO, progress: Progress, networks: Networks
) -> None:
    """Write a checkpoint, between rollouts; raises OSError if the file cannot be written."""
    name, key, *place = np.random.get_state()  # noqa: NPY002 - PPO shuffles minibatches with it
    batches, is_cuda = env_of(model).batches, model.device.type == "cuda"
    state = _tensors(model, networks) | {
        "version": CHECKPOINT_VERSION,
        "training": json.dumps(asdict(training)),
        "progress": asdict(progress),
        "seeds": [batch.seeds for batch in batches],
        "last_windows": [batch.last_window for batch in batches],
        "episode_starts": torch.tensor(model._last_episode_starts),
        "seeds_rng": env_of(model).rng.bit_generator.state,
        "numpy_rng": [name, np.asarray(key).tolist(), *place],
        "cuda_rng": torch.cuda.get_rng_state(model.device) if is_cuda else None,
    }
    content = io.BytesIO()
    torch.save(state, content)
    write_bytes(path, content.getbuffer())


def _tensors(model: PPO, networks: Networks) -> dict[str, Any]:
    """Return a run's tensors by their names in checkpoints."""
    env = model.get_env()
    normaliser = {}  # of rewards
    if isinstance(env, VecNormalize):
        moments = {name: getattr(env.ret_rms, name) for name in MOMENTS}
        normaliser = {name: torch.tensor(x, dtype=torch.float64) for name, x in moments.items()}
        normaliser["returns"] = torch.tensor(env.returns)
    return {
        "weights": model.policy.state_dict(),
        "adam": model.policy.optimizer.state_dict()["state"],  # its settings are the training's
        "recipients": {
            n: torch.tensor(np.array(batch.recipients, np.int16).reshape(-1, *batch.shape))
            for n, batch in enumerate(env_of(model).batches)
        },
        "normaliser": normaliser,
        "torch_rng": torch.get_rng_state(),
        "candidates": {at: network.state_dict() for at, network in networks.items()},
    }


def load(path: Path, training: Training, model: PPO) -> tuple[Progress, Networks]:
    """Put a model and its missions back to a checkpoint; return its progress and candidates.

    Raises ValueError if the file is damaged, foreign, of another version or of other settings,
    OSError if it cannot be read.
    """
    saved = read_torch(path, _max_bytes(model))
    state = saved if isinstance(saved, dict) else {}
    version = state.get("version")
    if version != CHECKPOINT_VERSION:
        raise ValueError(
            f"{path} is no checkpoint of swarm-mj train, or has version {version!r:.40}, and this "
            f"swarm_mj reads {CHECKPOINT_VERSION}; resume with the version that wrote it"
        )
    try:
        if read_json(state["training"], Training) != training:
            raise ValueError("it was made with other settings than the run's")
        return restore(state, model)
    except Exception as error:  # generators of random numbers take states as they please
        reason = (str(error) or type(error).__name__).splitlines()[0][:200]
        said = f"checkpoint {path} is damaged, or another run's ({reason})"
        raise ValueError(f"{said}; begin a new run with another --out") from error


def restore(state: Mapping[str, Any], model: PPO) -> tuple[Progress, Networks]:
    """Put a model and its missions back to a state; return the run's progress and candidates.

    Raises ValueError if the state is of other shapes, kinds or ranges, and any Exception if a part
    is missing, or of quite another kind.
    """
    plain = read_plain({spec.name: state[spec.name] for spec in fields(_Plain)}, _Plain)
    progress, env = plain.progress, env_of(model)
    num_rollouts, rest = divmod(progress.decisions, env.num_teams * model.n_steps)
    if rest:
        raise ValueError(f"its {progress.decisions} decisions are no whole rollouts")
    kept = [int(row["decisions"]) for row in candidates(progress.curve)]
    networks = {at: policy_of(model).acting_network() for at in kept}
    _check(state, plain, model, networks)
    for at, network in networks.items():
        network.load_state_dict(state["candidates"][at])
    policy, rewards = model.policy, model.get_env()
    policy.load_state_dict(state["weights"])
    policy.optimizer.load_state_dict(policy.optimizer.state_dict() | {"state": state["adam"]})
    model.num_timesteps = num_rollouts * model.n_steps * env.num_envs
    model._n_updates = num_rollouts * model.n_epochs
    recipients = [state["recipients"][n].numpy() for n in range(len(env.batches))]
    model._last_obs = env.replay(plain.seeds, plain.last_windows, recipients)
    model._last_episode_starts = state["episode_starts"].numpy()
    if isinstance(rewards, VecNormalize):
        for name in MOMENTS:
            setattr(rewards.ret_rms, name, state["normaliser"][name].item())
        rewards.returns = state["normaliser"]["returns"].numpy()
    # Last, as making networks and replaying missions may draw.
    torch.set_rng_state(state["torch_rng"])
    if state["cuda_rng"] is not None and model.device.type == "cuda":
        torch.cuda.set_rng_state(state["cuda_rng"], model.device)
    np.random.set_state(tuple(state["numpy_rng"]))  # noqa: NPY002 - as in `save`
    env.rng.bit_generator.state = state["seeds_rng"]
    return progress, networks


def _check(state: Mapping[str, Any], plain: _Plain, model: PPO, networks: Networks) -> None:
    """Raise ValueError unless a state is as one of this model's would be, in range and finite."""
    if not all(math.isfinite(row[name]) for row in plain.progress.curve for name in IN_A_ROW):
        raise ValueError("its curve has numbers that are not finite")
    # As a fresh model's, but for what optimiser steps and windows of missions have added.
    like = _tensors(model, networks)
    like["episode_starts"] = torch.zeros(model.n_envs, dtype=torch.bool)
    if plain.progress.decisions:
        like["adam"] = {
            n: {"step": torch.zeros(()), "exp_avg": weight, "exp_avg_sq": weight}
            for n, weight in enumerate(model.policy.parameters())
        }
    for n, (batch, last) in enumerate(zip(env_of(model).batches, plain.last_windows, strict=True)):
        num_flown, num_windows = len(state["recipients"][n]), batch.mission.num_windows
        if not num_flown < last <= num_windows:
            raise ValueError(f"its missions end at window {last}, not within {num_windows}")
        like["recipients"][n] = torch.zeros((num_flown, *batch.shape), dtype=torch.int16)
    _check_like({name: state[name] for name in like}, like, "it")
    steps = [moments["step"] for moments in state["adam"].values()]
    if any(each < 0 for each in (*steps, state["normaliser"].get("var", 0.0))):
        raise ValueError("its optimiser's step count, or its rewards' variance, is negative")


def _check_like(given: object, like: Mapping[Any, Any] | Tensor, name: str) -> None:
    """Raise ValueError unless all is plain, finite tensors of the same names, shapes and kinds."""
    if isinstance(like, Mapping):
        if not isinstance(given, Mapping) or given.keys() != like.keys():
            raise ValueError(f"{name} must have {', '.join(map(str, like)) or 'nothing'}")
        for key, each in like.items():
            _check_like(given[key], each, str(key))
        return
    if (
        type(given) is not Tensor  # a class of its own might run code
        or given.layout != torch.strided
        or (given.shape, given.dtype) != (like.shape, like.dtype)
    ):
        raise ValueError(f"{name} must be {list(like.shape)} of {like.dtype}")
    if not torch.isfinite(given).all():
        raise ValueError(f"{name} has numbers that are not finite")


def _max_bytes(model: PPO) -> int:
    # Weights, Adam's two moments of them and the candidates; recipients; much room for the curve.
    weights = sum(weight.nbytes for weight in model.policy.parameters()) * (3 + NUM_BEST + 1)
    batches = env_of(model).batches
    decisions = sum(batch.mission.num_windows * math.prod(batch.shape) for batch in batches)
    return 2 * (weights + np.dtype(np.int16).itemsize * decisions) + SPARE_BYTES


def read_torch(path: Path, max_bytes: int) -> object:
    """Return what a file of torch holds, without running code from it.

    Raises ValueError if it is missing, too large, damaged or foreign, or a link out of its folder,
    OSError if it cannot be read.
    """
    content = io.BytesIO(read_file(path, "checkpoint", max_bytes, folder=path.parent))
    try:
        # Torch checks no sums itself; what is compressed could grow beyond the memory.
        with zipfile.ZipFile(content) as archive:
            is_plain = all(entry.compress_type == zipfile.ZIP_STORED for entry in archive.filelist)
            if not is_plain or archive.testzip() is not None:
                raise zipfile.BadZipFile
        content.seek(0)
        return torch.load(content, map_location="cpu", weights_only=True)
    except Exception as error:  # torch names no exception of its own for damaged files
        raise ValueError(
            f"checkpoint {path} is damaged, or none; begin a new run with another --out"
        ) from error
