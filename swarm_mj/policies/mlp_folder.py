"""Plain networks on disk: a policy's folder whose config says of which size and kind they are."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from swarm_mj.gnn.feature_sets import make_extractor
from swarm_mj.io.reading import read_document
from swarm_mj.mission import Mission
from swarm_mj.policies.mlp import MlpPolicy, MlpShape, Weights
from swarm_mj.policies.policy_folder import (
    CARD,
    CONFIG,
    WAY_OUT,
    WEIGHTS,
    present_policy,
    read_part,
    write_policy,
)

MLP_FORMAT, VERSION = "swarm_mj mlp policy", 1


@dataclass(frozen=True, kw_only=True)
class MlpConfig:
    """All of a plain network but its weights."""

    network: MlpShape
    training: dict[str, Any]  # JSON: what is known of how it was trained
    version: str  # of swarm_mj that stored it


def save_mlp(folder: Path, weights: Weights, config: MlpConfig) -> None:
    """Writes a plain network as a policy, whole or not at all; a policy there is replaced.

    Raises:
        ValueError: `load_mlp` would not take it, or the folder holds other files than a policy's.
        OSError: The folder cannot be written.
    """
    _check_weights(weights, config.network)
    document = {"format": MLP_FORMAT, "format_version": VERSION, **asdict(config)}
    contents = {
        WEIGHTS: save({name: np.ascontiguousarray(each) for name, each in weights.items()}),
        CONFIG: (json.dumps(document, indent=2, allow_nan=False) + "\n").encode(),
        CARD: _card(config).encode(),
    }
    write_policy(folder, contents, check=read_mlp)


def read_mlp(folder: Path) -> tuple[Weights, MlpConfig]:
    """A plain network's weights and config.

    Raises:
        ValueError: There is none, or it is damaged, foreign, oversized or of a newer version.
        OSError: It cannot be read.
    """
    present, name = present_policy(folder), CONFIG
    try:
        config = read_document(read_part(present, name), MLP_FORMAT, VERSION, MlpConfig)
        name = WEIGHTS
        weights = _weights(read_part(present, name))
        _check_weights(weights, config.network)
    except ValueError as error:
        raise ValueError(f"{folder / name}: {error}; {WAY_OUT}") from error
    return weights, config


def load_mlp(folder: Path, mission: Mission, *, is_deterministic: bool = False) -> MlpPolicy:
    """A plain network, ready to fly a mission with as many robots as it was trained on.

    Raises:
        ValueError: The mission has another number of robots; else as `read_mlp`.
        OSError: It cannot be read.
    """
    weights, config = read_mlp(folder)
    size = config.network.num_robots
    if mission.num_robots != size:
        raise ValueError(
            f"policy {folder} flies teams of {size} robots, for which it was trained, not "
            f"{mission.num_robots}; choose --robots {size}"
        )
    extractor = make_extractor(config.network.features, mission)
    return MlpPolicy(config.network, weights, extractor, is_deterministic=is_deterministic)


def _weights(data: bytes) -> Weights:
    try:
        return load(data)
    except (SafetensorError, AssertionError, KeyError, RuntimeError, ValueError) as error:
        raise ValueError(f"it is damaged, or no safetensors file ({error})") from error


def _check_weights(weights: Mapping[str, np.ndarray], shape: MlpShape) -> None:
    """Raises ValueError unless these are the weights of a network of that shape, all finite."""
    expected = shape.tensors()
    for name in sorted(expected.keys() ^ weights.keys()):
        known = "lacks the" if name in expected else "has an unknown"
        raise ValueError(f"it {known} tensor {name:.80}")
    for name, values in weights.items():
        if values.shape != expected[name] or values.dtype != np.float32:
            raise ValueError(
                f"tensor {name} must be {list(expected[name])} of float32, not "
                f"{list(values.shape)} of {values.dtype}"
            )
        if not np.all(np.isfinite(values)):
            raise ValueError(f"tensor {name} has numbers that are not finite")


def _card(config: MlpConfig) -> str:
    shape = config.network
    widths = " and ".join(map(str, shape.hidden)) or "no"
    described = [f"- {key}: {value}" for key, value in config.training.items()]
    parts = [
        "# A learned communication policy of swarm_mj",
        "Every robot evaluates this network on what it knows of its teammates, and draws from the "
        "result whom it addresses in the next window, or that it stays silent.",
        f"- network: perceptrons, {widths} hidden units, {shape.activation}\n"
        "- packets: T, M and P, as the paper's, and nothing more\n"
        f"- features: `{shape.features}`",
        "## Fly it",
        f"    swarm-mj fly --policy DIR --robots {shape.num_robots}",
        f"`DIR` is this folder. It flies teams of {shape.num_robots} robots only.",
        "## Training",
        "\n".join(described) or "Nothing was noted.",
        f"Stored by swarm_mj {config.version}.",
    ]
    return "\n\n".join(parts) + "\n"
