"""Checkpoints: all that a run needs to go on as if it had never stopped.

One file of tensors, numbers and strings. It is read without running code from it, and it is whole
or not there.
"""

import io
import json
import zipfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from swarm_mj.io.atomic import atomic_write
from swarm_mj.learning.mission_batch import ActionHistory
from swarm_mj.learning.run_folder import Accumulator, Progress
from swarm_mj.learning.settings import Training
from swarm_mj.learning.vec_env import MissionsEnv

CHECKPOINT_VERSION = 2


def save(
    path: Path, training: Training, model: PPO, rng: np.random.Generator, progress: Progress
) -> None:
    """Writes a checkpoint; call it between rollouts. `rng` draws the missions' seeds.

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
            vars(batch.history)
            | {"recipients": torch.tensor(np.array(batch.history.recipients, dtype=np.int16))}
            for batch in missions_of(model).batches
        ],
        "reward_normaliser": _normaliser_state(model),
        "torch_rng": torch.get_rng_state(),
        "cuda_rng": torch.cuda.get_rng_state(model.device) if model.device.type == "cuda" else None,
        "numpy_rng": [name, np.asarray(keys).tolist(), *rest],
        "seeds_rng": rng.bit_generator.state,
        "progress": asdict(progress),
    }
    content = io.BytesIO()
    torch.save(state, content)
    with atomic_write(path) as part:
        part.write_bytes(content.getbuffer())


def load(path: Path, training: Training, model: PPO, rng: np.random.Generator) -> Progress:
    """Puts a model and its missions, made of these settings, back to where a checkpoint was made.

    Raises:
        ValueError: The file is damaged, foreign, of a newer version or of other settings.
        OSError: The file cannot be read.
    """
    state = _read(path)
    try:
        if json.loads(state["training"]) != json.loads(json.dumps(asdict(training))):
            raise ValueError("it was made with other settings than the run's")
        return _restore(state, model, rng)
    except (KeyError, TypeError, ValueError, RuntimeError, AttributeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(
            f"checkpoint {path} is damaged, or another run's ({reason}); begin a new run with "
            "another --out"
        ) from error


def missions_of(model: PPO) -> MissionsEnv:
    """The environment inside what may be wrapped around it."""
    env = model.get_env()
    inner = env.unwrapped if env is not None else None
    assert isinstance(inner, MissionsEnv)
    return inner


def _read(path: Path) -> dict[str, Any]:
    """Raises ValueError for what is no whole checkpoint of this version."""
    content = io.BytesIO(path.read_bytes())
    try:
        with zipfile.ZipFile(content) as archive:
            if archive.testzip() is not None:
                raise zipfile.BadZipFile
        content.seek(0)
        state = torch.load(content, map_location="cpu", weights_only=True)
    except Exception as error:  # torch names no exception of its own for damaged files
        raise ValueError(
            f"checkpoint {path} is damaged, or none; begin a new run with another --out"
        ) from error
    if not isinstance(state, dict) or "version" not in state:
        raise ValueError(f"{path} is no checkpoint of swarm-mj train")
    if state["version"] != CHECKPOINT_VERSION:
        raise ValueError(
            f"checkpoint {path} has version {state['version']!r:.40}, and this swarm_mj reads "
            f"{CHECKPOINT_VERSION}; resume with the version that wrote it"
        )
    return state


def _restore(state: dict[str, Any], model: PPO, rng: np.random.Generator) -> Progress:
    model.set_parameters(state["parameters"], device=model.device)
    model.num_timesteps = state["num_timesteps"]
    model._n_updates = state["num_updates"]
    env = missions_of(model)
    graphs = [
        batch.replay(ActionHistory(**history | {"recipients": [*history["recipients"].numpy()]}))
        for batch, history in zip(env.batches, state["histories"], strict=True)
    ]
    model._last_obs = env.observe(graphs)
    model._last_episode_starts = state["episode_starts"].numpy()
    _restore_normaliser(model, state["reward_normaliser"])
    torch.set_rng_state(state["torch_rng"])
    if state["cuda_rng"] is not None and model.device.type == "cuda":
        torch.cuda.set_rng_state(state["cuda_rng"], model.device)
    np.random.set_state(tuple(state["numpy_rng"]))  # noqa: NPY002 - as in `save`
    rng.bit_generator.state = state["seeds_rng"]
    progress = state["progress"]
    accumulator = Accumulator(**progress["since_evaluation"])
    return Progress(**progress | {"since_evaluation": accumulator})


def _normaliser_state(model: PPO) -> dict[str, Any] | None:
    """The running variance of returns, if rewards are normalised."""
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
