"""Checkpoints: all that a run needs to go on as if it had never stopped.

One file of tensors, numbers and strings. It is read without running code from it, and it is whole
or not there.
"""

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from swarm_mj.io.atomic_file import atomic_write
from swarm_mj.learning import progress as progresses
from swarm_mj.learning.env import MissionsEnv
from swarm_mj.learning.missions import Course
from swarm_mj.learning.progress import Progress
from swarm_mj.learning.settings import Training

CHECKPOINT_VERSION = 1


def save(
    path: Path, training: Training, model: PPO, rng: np.random.Generator, progress: Progress
) -> None:
    """Writes a checkpoint; call it between rollouts.

    Args:
        path: The file.
        training: The run's settings.
        model: Its environment is a `MissionsEnv`, normalised or not.
        rng: Draws the missions' seeds.
        progress: Kept along.

    Raises:
        OSError: The file cannot be written.
    """
    courses = [group.course() for group in missions_of(model).groups]
    state: dict[str, Any] = {
        "version": CHECKPOINT_VERSION,
        "training": json.dumps(training.to_json()),
        "policy": model.policy.state_dict(),
        "optimizer": model.policy.optimizer.state_dict(),
        "num_timesteps": model.num_timesteps,
        "num_updates": model._n_updates,
        "episode_starts": torch.from_numpy(np.array(model._last_episode_starts)),
        "courses": [
            {
                "seeds": course.seeds,
                "last_window": course.last_window,
                "recipients": torch.from_numpy(course.recipients),
            }
            for course in courses
        ],
        "reward_normaliser": _normaliser_state(model),
        "torch_rng": torch.get_rng_state(),
        "cuda_rng": torch.cuda.get_rng_state(model.device) if _is_on_cuda(model) else None,
        "numpy_rng": _legacy_numpy_state(),
        "seeds_rng": json.dumps(rng.bit_generator.state),
        "progress": progress.to_json(),
    }
    content = io.BytesIO()
    torch.save(state, content)
    with atomic_write(path) as part:
        part.write_bytes(content.getbuffer())


def load(path: Path, training: Training, model: PPO, rng: np.random.Generator) -> Progress:
    """Puts a run back to where a checkpoint was made.

    Args:
        path: The file.
        training: The run's settings.
        model: Made of these settings; it and its missions are changed.
        rng: As in `save`; changed.

    Returns:
        The progress.

    Raises:
        ValueError: The file is damaged, foreign, of a newer version or of other settings.
        OSError: The file cannot be read.
    """
    state = _read(path)
    try:
        if json.loads(state["training"]) != json.loads(json.dumps(training.to_json())):
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
            flawed = archive.testzip()
        content.seek(0)
        state = None if flawed else torch.load(content, map_location="cpu", weights_only=True)
    except Exception as error:  # torch names no exception of its own for damaged files
        raise ValueError(_damaged(path)) from error
    if flawed:
        raise ValueError(_damaged(path))
    if not isinstance(state, dict) or "version" not in state:
        raise ValueError(f"{path} is no checkpoint of swarm-mj train")
    if state["version"] != CHECKPOINT_VERSION:
        raise ValueError(
            f"checkpoint {path} has version {state['version']!r:.40}, and this swarm_mj reads "
            f"{CHECKPOINT_VERSION}; resume with the version that wrote it"
        )
    return state


def _damaged(path: Path) -> str:
    return f"checkpoint {path} is damaged, or none; begin a new run with another --out"


def _restore(state: dict[str, Any], model: PPO, rng: np.random.Generator) -> Progress:
    model.policy.load_state_dict(state["policy"])
    model.policy.optimizer.load_state_dict(state["optimizer"])
    model.num_timesteps = state["num_timesteps"]
    model._n_updates = state["num_updates"]
    env = missions_of(model)
    graphs = [
        group.fly_again(
            Course(
                seeds=course["seeds"],
                last_window=course["last_window"],
                recipients=course["recipients"].numpy(),
            )
        )
        for group, course in zip(env.groups, state["courses"], strict=True)
    ]
    model._last_obs = env.observe(graphs)
    model._last_episode_starts = state["episode_starts"].numpy()
    _restore_normaliser(model, state["reward_normaliser"])
    torch.set_rng_state(state["torch_rng"])
    if state["cuda_rng"] is not None and _is_on_cuda(model):
        torch.cuda.set_rng_state(state["cuda_rng"], model.device)
    _restore_legacy_numpy(state["numpy_rng"])
    rng.bit_generator.state = json.loads(state["seeds_rng"])
    return progresses.from_json(state["progress"])


def _is_on_cuda(model: PPO) -> bool:
    return model.device.type == "cuda"


def _legacy_numpy_state() -> str:
    """NumPy's global generator, which stable-baselines3 shuffles minibatches with."""
    name, keys, position, has_gauss, gauss = np.random.get_state()  # noqa: NPY002
    return json.dumps([name, np.asarray(keys).tolist(), position, has_gauss, gauss])


def _restore_legacy_numpy(state: str) -> None:
    name, keys, *rest = json.loads(state)
    np.random.set_state((name, np.array(keys, dtype=np.uint32), *rest))  # noqa: NPY002


def _normaliser_state(model: PPO) -> dict[str, Any] | None:
    """The running variance of returns, if rewards are normalised."""
    env = model.get_env()
    if not isinstance(env, VecNormalize):
        return None
    running = env.ret_rms
    return {
        "mean": float(running.mean),
        "var": float(running.var),
        "count": float(running.count),
        "returns": torch.from_numpy(env.returns.copy()),
    }


def _restore_normaliser(model: PPO, state: dict[str, Any] | None) -> None:
    env = model.get_env()
    if isinstance(env, VecNormalize) and state is not None:
        env.ret_rms.mean = np.array(state["mean"])
        env.ret_rms.var = np.array(state["var"])
        env.ret_rms.count = state["count"]
        env.returns = state["returns"].numpy()
