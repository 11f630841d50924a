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
from typing import Annotated, Any, Literal

import numpy as np
import torch
from msgspec import Meta
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize
from torch import Tensor

from swarm_mj.learning.graph_vec_env import env_of
from swarm_mj.learning.ppo import GnnActorCritic
from swarm_mj.learning.selection import NUM_BEST, Amount, Count, Progress, candidates
from swarm_mj.learning.settings import Training
from swarm_mj.policies.gnn.network import AggregationGnn
from swarm_mj.system.reading import read_file, read_json, read_plain
from swarm_mj.system.writing import write_bytes

CHECKPOINT_VERSION = 4
SPARE_BYTES = 100_000_000  # the curve's, and what else does not depend on the settings
IN_A_ROW = (  # of the learning curve
    *("decisions", "minutes", "aoi", "aoi_steady", "velocity_variance", "objective"),
    *("packets_per_window", "delivery_ratio"),
)

Networks = dict[int, AggregationGnn]  # of policies that may be kept, by their decisions
Word = Annotated[int, Meta(ge=0, lt=2**32)]


@dataclass(frozen=True, kw_only=True)
class _Counters:
    """The part of a checkpoint that is neither tensors nor a library's own state."""

    num_timesteps: Count
    num_updates: Count
    seeds: list[list[int]]  # of the missions under way, by batch; replaying checks their range
    last_windows: list[int]  # when they end, by batch
    # Of `VecNormalize`: the mean, variance and count of its returns.
    reward_moments: tuple[Annotated[float, Meta(ge=-1e30, le=1e30)], Amount, Amount] | None
    numpy_rng: tuple[
        Literal["MT19937"],
        Annotated[list[Word], Meta(min_length=624, max_length=624)],
        Annotated[int, Meta(ge=0, le=624)],  # NumPy reads the word there unchecked
        Annotated[int, Meta(ge=0, le=1)],
        float,
    ]
    progress: Progress


def save(
    path: Path, training: Training, model: PPO, progress: Progress, networks: Networks
) -> None:
    """Write a checkpoint, between rollouts; raises OSError if the file cannot be written."""
    name, keys, *rest = np.random.get_state()  # noqa: NPY002 - PPO shuffles minibatches with it
    env, batches = model.get_env(), env_of(model).batches
    is_normalised = isinstance(env, VecNormalize)
    moments = [env.ret_rms.mean, env.ret_rms.var, env.ret_rms.count] if is_normalised else None
    is_cuda = model.device.type == "cuda"
    state = _tensors(model, networks) | {
        "version": CHECKPOINT_VERSION,
        "training": json.dumps(asdict(training)),
        "num_timesteps": model.num_timesteps,
        "num_updates": model._n_updates,
        "episode_starts": torch.tensor(model._last_episode_starts),
        "seeds": [batch.seeds for batch in batches],
        "last_windows": [batch.last_window for batch in batches],
        "reward_moments": moments and [float(each) for each in moments],
        "cuda_rng": torch.cuda.get_rng_state(model.device) if is_cuda else None,
        "numpy_rng": [name, np.asarray(keys).tolist(), *rest],
        "seeds_rng": env_of(model).rng.bit_generator.state,
        "progress": asdict(progress),
    }
    content = io.BytesIO()
    torch.save(state, content)
    write_bytes(path, content.getbuffer())


def _tensors(model: PPO, networks: Networks) -> dict[str, Any]:
    """Return a run's tensors by their names in checkpoints, but for what a first rollout makes."""
    env = model.get_env()
    return {
        "weights": model.policy.state_dict(),
        "adam": model.policy.optimizer.state_dict()["state"],  # its settings are the training's
        "recipients": {
            n: torch.tensor(np.array(batch.recipients, np.int16).reshape(-1, *batch.shape))
            for n, batch in enumerate(env_of(model).batches)
        },
        "returns": torch.tensor(env.returns if isinstance(env, VecNormalize) else []),
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


def acting_network(model: PPO) -> AggregationGnn:
    """Return a copy of the network that acts."""
    assert isinstance(model.policy, GnnActorCritic)
    return model.policy.acting_network()


def restore(state: Mapping[str, Any], model: PPO) -> tuple[Progress, Networks]:
    """Put a model and its missions back to a state; return the run's progress and candidates.

    Raises ValueError if the state is of other shapes, kinds or ranges, and any Exception if a part
    is missing, or of quite another kind.
    """
    counters = read_plain({spec.name: state[spec.name] for spec in fields(_Counters)}, _Counters)
    progress = counters.progress
    kept = [int(row["decisions"]) for row in candidates(progress.curve)]
    networks = {at: acting_network(model) for at in kept}
    _check(state, counters, model, networks)
    for at, network in networks.items():
        network.load_state_dict(state["candidates"][at])
    policy, env = model.policy, model.get_env()
    policy.load_state_dict(state["weights"])
    policy.optimizer.load_state_dict(policy.optimizer.state_dict() | {"state": state["adam"]})
    model.num_timesteps, model._n_updates = counters.num_timesteps, counters.num_updates
    recipients = [state["recipients"][n].numpy() for n in range(len(counters.seeds))]
    model._last_obs = env_of(model).replay(counters.seeds, counters.last_windows, recipients)
    model._last_episode_starts = state["episode_starts"].numpy()
    if isinstance(env, VecNormalize) and counters.reward_moments is not None:
        for name, value in zip(("mean", "var", "count"), counters.reward_moments, strict=True):
            setattr(env.ret_rms, name, value)
        env.returns = state["returns"].numpy()
    # Last, as making networks and replaying missions may draw.
    torch.set_rng_state(state["torch_rng"])
    if state["cuda_rng"] is not None and model.device.type == "cuda":
        torch.cuda.set_rng_state(state["cuda_rng"], model.device)
    np.random.set_state(tuple(state["numpy_rng"]))  # noqa: NPY002 - as in `save`
    env_of(model).rng.bit_generator.state = state["seeds_rng"]
    return progress, networks


def _check(state: Mapping[str, Any], counters: _Counters, model: PPO, networks: Networks) -> None:
    """Raise ValueError unless a state is as one of this model's would be, in range and finite."""
    progress, env = counters.progress, env_of(model)
    if not all(math.isfinite(row[name]) for row in progress.curve for name in IN_A_ROW):
        raise ValueError("its curve has numbers that are not finite")
    if counters.num_timesteps * env.num_teams != progress.decisions * env.num_envs:
        raise ValueError("its steps are not those of its decisions")
    if (counters.reward_moments is not None) != isinstance(model.get_env(), VecNormalize):
        raise ValueError("it normalises rewards, or does not, unlike the run")
    # As a fresh model's, but for what optimiser steps and windows of missions have added.
    like = _tensors(model, networks)
    like["episode_starts"] = torch.zeros(model.n_envs, dtype=torch.bool)
    if state["adam"]:
        like["adam"] = {
            n: {"step": torch.zeros(()), "exp_avg": weight, "exp_avg_sq": weight}
            for n, weight in enumerate(model.policy.parameters())
        }
    for n, (batch, last) in enumerate(zip(env.batches, counters.last_windows, strict=True)):
        num_flown, num_windows = len(state["recipients"][n]), batch.mission.num_windows
        if not num_flown < last <= num_windows:
            raise ValueError(f"its missions end at window {last}, not within {num_windows}")
        like["recipients"][n] = torch.zeros((num_flown, *batch.shape), dtype=torch.int16)
    _check_like({name: state[name] for name in like}, like, "it")
    if any(moments["step"] < 0 for moments in state["adam"].values()):
        raise ValueError("its optimiser's step count is negative")


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
