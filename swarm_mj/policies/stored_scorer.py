"""A learned scorer on disk: a folder of its weights, where they come from, and a card."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from safetensors import SafetensorError
from safetensors.numpy import load, save

from swarm_mj.policies.worth_network import WorthNetwork
from swarm_mj.scene import asset
from swarm_mj.whole_folder import present_folder, whole_folder

FORMAT = "swarm_mj plan network"
FORMAT_VERSION = 1
WEIGHTS, CONFIG, CARD = "model.safetensors", "config.json", "README.md"
MAX_BYTES = 1_000_000
DIGITS = 12  # of a digest: enough to tell scorers apart
SHIPPED = "policies/gnn"  # in assets/
WAY_OUT = "copy it again, or make one with training/plan_network.py"


def save_scorer(
    folder: Path,
    parameters: Mapping[str, Float[np.ndarray, "..."]],
    training: Mapping[str, Any],
    card: str,
) -> None:
    """Writes a scorer, whole or not at all.

    Args:
        folder: Where; what is there is replaced.
        parameters: Its weights, by name.
        training: JSON: the command, the seed, the budget spent, the commit.
        card: The README.

    Raises:
        ValueError: `WorthNetwork` would not take the weights.
        OSError: The folder cannot be written.
    """
    WorthNetwork(parameters, digest="")
    tensors = {name: np.ascontiguousarray(a, np.float32) for name, a in parameters.items()}
    config = {"format": FORMAT, "format_version": FORMAT_VERSION, "training": dict(training)}
    with whole_folder(folder) as part:
        (part / WEIGHTS).write_bytes(save(tensors))
        (part / CONFIG).write_text(json.dumps(config, indent=2, allow_nan=False) + "\n")
        (part / CARD).write_text(card)


def load_scorer(folder: Path) -> WorthNetwork:
    """A scorer that `save_scorer` wrote.

    Raises:
        ValueError: There is none, or it is damaged, foreign, oversized or of a newer version.
        OSError: It cannot be read.
    """
    present = present_folder(folder)
    try:
        config = json.loads(_read(present / CONFIG))
        if not isinstance(config, dict) or config.get("format") != FORMAT:
            raise ValueError(f'its format must be "{FORMAT}"')
        version = config.get("format_version")
        if version != FORMAT_VERSION:
            raise ValueError(f"its format_version must be {FORMAT_VERSION}, not {version!r:.40}")
        data = _read(present / WEIGHTS)
        tensors = load(data)
        for name, array in tensors.items():
            if array.dtype != np.float32:
                raise ValueError(f"tensor {name:.80} must be of float32, not {array.dtype}")
        return WorthNetwork(tensors, hashlib.sha256(data).hexdigest()[:DIGITS])
    except (SafetensorError, ValueError, KeyError, RecursionError) as error:
        raise ValueError(f"policy {folder}: {error}; {WAY_OUT}") from error


def is_scorer(folder: Path) -> bool:
    """Whether a folder says that it holds a scorer, be it sound or not."""
    path = present_folder(folder) / CONFIG
    try:
        config = json.loads(_read(path))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(config, dict) and config.get("format") == FORMAT


def shipped_scorer() -> WorthNetwork:
    """The scorer that comes with the package: that of policy `gnn`."""
    return load_scorer(asset(f"{SHIPPED}/{CONFIG}").parent)


def _read(path: Path) -> bytes:
    """A file's bytes.

    Raises:
        ValueError: It is missing or oversized.
    """
    if not path.is_file():
        raise ValueError(f"there is no {path.name}")
    if path.stat().st_size > MAX_BYTES:
        raise ValueError(f"{path.name} may have up to {MAX_BYTES} bytes")
    return path.read_bytes()
