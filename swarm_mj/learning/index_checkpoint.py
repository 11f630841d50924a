"""Checkpoints of the search for an index: like those of networks, `checkpoint`, but smaller."""

import io
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from swarm_mj.learning.checkpoint import (
    as_damaged,
    read_progress,
    read_torch,
    written_progress,
)
from swarm_mj.learning.evolution import Search
from swarm_mj.learning.selection import Progress
from swarm_mj.learning.settings import Training
from swarm_mj.policies.index.weights import FEATURES, Weights, flat, from_flat
from swarm_mj.system.reading import read_json
from swarm_mj.system.writing import write_bytes

INDEX_CHECKPOINT_VERSION = 1


@dataclass(kw_only=True)
class State:
    """The state of a run between two generations."""

    progress: Progress
    search: Search
    kept: Mapping[int, Weights]  # what may be chosen, by the decisions behind it


def save(path: Path, training: Training, state: State, rng: np.random.Generator) -> None:
    """Write a checkpoint, between generations; raises OSError if the file cannot be written."""
    search = asdict(state.search)
    for name, value in search.items():
        if isinstance(value, np.ndarray):
            search[name] = torch.from_numpy(value.copy())
    content = io.BytesIO()
    stored = {
        "index_version": INDEX_CHECKPOINT_VERSION,
        "training": json.dumps(asdict(training)),
        "feature_names": list(FEATURES),
        "progress": written_progress(state.progress),
        "search": search,
        "candidates": {at: torch.from_numpy(flat(its)) for at, its in state.kept.items()},
        "rng": rng.bit_generator.state,
    }
    torch.save(stored, content)
    write_bytes(path, content.getbuffer())


def load(path: Path, training: Training, rng: np.random.Generator) -> State:
    """Return what a checkpoint holds, and put the generator back to it.

    Raises ValueError if the file cannot be read, is damaged or no checkpoint, or is of another
    version, of other settings, or of features that are others now.
    """
    stored: Any = read_torch(path)
    with as_damaged(path):
        if stored["index_version"] != INDEX_CHECKPOINT_VERSION:
            raise ValueError("another version of swarm_mj wrote it, which can go on with it")
        if read_json(stored["training"], Training) != training:
            raise ValueError("it was made with other settings than the run's")
        if tuple(stored["feature_names"]) != FEATURES:
            raise ValueError("the features of index-csma are others now")
        search = dict(stored["search"])
        for name, value in search.items():
            if isinstance(value, torch.Tensor):
                search[name] = value.numpy()
        kept = {at: from_flat(numbers.numpy()) for at, numbers in stored["candidates"].items()}
        state = State(
            progress=read_progress(stored["progress"]), search=Search(**search), kept=kept
        )
        rng.bit_generator.state = stored["rng"]
    return state
