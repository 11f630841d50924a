"""Checkpoints: all that a run needs to go on as if it had never stopped.

One file of tensors, numbers and strings, read without running code from it. It is written whole or
not at all; yet disks and copies may damage it later, so its sums are checked when it is read, and
that it was made with the run's settings.
"""

import io
import json
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from swarm_mj.learning.graph_vec_env import env_of
from swarm_mj.learning.ppo import networks_of
from swarm_mj.learning.selection import Columns, Progress, candidates, curve_row_of
from swarm_mj.learning.settings import Training
from swarm_mj.policies.gnn.feature_sets import check_unchanged, known_names
from swarm_mj.policies.gnn.network import Network
from swarm_mj.system.reading import open_file, read_json, read_plain
from swarm_mj.system.writing import write_bytes

CHECKPOINT_VERSION = 7
MOMENTS = ("mean", "var", "count")  # of `VecNormalize`'s returns

Networks = dict[int, Network]  # of policies that may be kept, by their decisions


@dataclass(frozen=True)
class _Curve:
    """The rows of a learning curve, as they are stored."""

    rows: list[Columns]


def save(
    path: Path, training: Training, model: PPO, progress: Progress, networks: Networks
) -> None:
    """Write a checkpoint, between rollouts; raises OSError if the file cannot be written."""
    # NumPy's global state, for PPO shuffles minibatches with it.
    name, key, *place = np.random.get_state()  # noqa: NPY002
    batches = env_of(model).batches
    env = model.get_env()
    memory = env_of(model).memory
    normaliser = {}  # of rewards
    if isinstance(env, VecNormalize):
        for moment in MOMENTS:
            value = getattr(env.ret_rms, moment)
            normaliser[moment] = torch.tensor(value, dtype=torch.float64)
        normaliser["returns"] = torch.tensor(env.returns)
    recipients = {}
    for n, batch in enumerate(batches):
        decided = np.array(batch.recipients, np.int16).reshape(-1, *batch.shape)
        recipients[n] = torch.tensor(decided)
    state = {
        "version": CHECKPOINT_VERSION,
        "training": json.dumps(asdict(training)),
        "feature_names": list(known_names(training.features)),
        "progress": written_progress(progress),
        "weights": model.policy.state_dict(),
        "adam": model.policy.optimizer.state_dict()["state"],  # its settings are the training's
        "normaliser": normaliser,
        "candidates": {at: network.state_dict() for at, network in networks.items()},
        # When a run goes on, its missions are flown again from seeds and decisions, from which all
        # that physics, channel and buffers hold follows.
        "recipients": recipients,
        "credit_scales": [[scale.total, scale.count] for scale in env_of(model).credit_scales],
        # It followed from weights that are no more.
        "memory": None if memory is None else torch.tensor(memory),
        "seeds": [batch.seeds for batch in batches],
        "last_windows": [batch.last_window for batch in batches],
        "episode_starts": torch.tensor(model._last_episode_starts),
        "seeds_rng": env_of(model).rng.bit_generator.state,
        "torch_rng": torch.get_rng_state(),
        "numpy_rng": [name, np.asarray(key).tolist(), *place],
    }
    content = io.BytesIO()
    torch.save(state, content)
    write_bytes(path, content.getbuffer())


def load(path: Path, training: Training, model: PPO) -> tuple[Progress, Networks]:
    """Put a model and its missions back to a checkpoint; return its progress and candidates.

    Raises ValueError if the file cannot be read, is damaged or no checkpoint, or is of another
    version, of other settings, or of features that are others now.
    """
    state: Any = read_torch(path)
    with as_damaged(path):
        if state["version"] != CHECKPOINT_VERSION:
            raise ValueError("another version of swarm_mj wrote it, which can go on with it")
        if read_json(state["training"], Training) != training:
            raise ValueError("it was made with other settings than the run's")
        trained_on = tuple(state["feature_names"])
    check_unchanged(training.features, trained_on, f"checkpoint {path}")
    with as_damaged(path):
        return restore(state, model)


def written_progress(progress: Progress) -> dict[str, Any]:
    """Return a run's progress as plain values."""
    return asdict(progress) | {"curve": [row.columns() for row in progress.curve]}


def read_progress(stored: dict[str, Any]) -> Progress:
    """Return what `written_progress` was made of; raises any Exception for what is none."""
    progress = read_plain(stored | {"curve": []}, Progress)
    curve = read_plain({"rows": stored["curve"]}, _Curve)
    progress.curve = [curve_row_of(row) for row in curve.rows]
    return progress


@contextmanager
def as_damaged(path: Path) -> Iterator[None]:
    """Turn whatever goes wrong into a ValueError that names the checkpoint and the way out."""
    try:
        yield
    except Exception as error:  # generators of random numbers take states as they please
        reason = (str(error) or type(error).__name__).splitlines()[0][:200]
        said = f"checkpoint {path} is damaged, or another run's ({reason})"
        raise ValueError(f"{said}; begin a new run with another --out") from error


def restore(state: Mapping[str, Any], model: PPO) -> tuple[Progress, Networks]:
    """Put a model and its missions back to a state; return the run's progress and candidates.

    Raises any Exception if a part is missing, or does not fit the model.
    """
    progress = read_progress(state["progress"])
    env = env_of(model)
    num_rollouts = progress.decisions // (env.num_teams * model.n_steps)
    networks = Networks()
    for row in candidates(progress.curve):
        network = networks_of(model).acting_network()
        network.load_state_dict(state["candidates"][row.decisions])
        networks[row.decisions] = network
    model.policy.load_state_dict(state["weights"])
    optimizer = model.policy.optimizer
    # Only Adam's moments are the file's; its rate and epsilon are of the settings.
    optimizer.load_state_dict(optimizer.state_dict() | {"state": state["adam"]})
    model.num_timesteps = num_rollouts * model.n_steps * env.num_envs
    model._n_updates = num_rollouts * model.n_epochs
    recipients = [state["recipients"][n].numpy() for n in range(len(env.batches))]
    if env.memory is not None:
        env.memory[:] = state["memory"].numpy()
    model._last_obs = env.replay(state["seeds"], state["last_windows"], recipients)
    model._last_episode_starts = state["episode_starts"].numpy()
    if env.credit_scales:
        for scale, (total, count) in zip(env.credit_scales, state["credit_scales"], strict=True):
            scale.total = total
            scale.count = count
    rewards = model.get_env()
    if isinstance(rewards, VecNormalize):
        for name in MOMENTS:
            setattr(rewards.ret_rms, name, state["normaliser"][name].item())
        rewards.returns = state["normaliser"]["returns"].numpy()
    # Last, as making networks and replaying missions may draw.
    torch.set_rng_state(state["torch_rng"])
    np.random.set_state(tuple(state["numpy_rng"]))  # noqa: NPY002 - as in `save`
    env.rng.bit_generator.state = state["seeds_rng"]
    return progress, networks


def read_torch(path: Path) -> object:
    """Return what a file of torch holds, without running code from it.

    Raises ValueError if it is missing, cannot be read, is damaged or no file of torch's.
    """
    with open_file(path, "checkpoint") as file:
        try:
            with zipfile.ZipFile(file) as archive:
                if archive.testzip() is not None:  # torch checks no sums itself
                    raise zipfile.BadZipFile
            file.seek(0)
            return torch.load(file, map_location="cpu", weights_only=True)
        except Exception as error:  # torch names no exception of its own for damaged files
            raise ValueError(
                f"checkpoint {path} is damaged, or none; begin a new run with another --out"
            ) from error
