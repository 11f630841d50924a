"""Plain networks on disk: a policy's folder whose config says of which size and kind they are."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from swarm_mj.mission import Mission
from swarm_mj.policies.gnn.feature_sets import trained_extractor
from swarm_mj.policies.mlp import MlpPolicy, MlpShape, Weights
from swarm_mj.policies.model_card import mlp_card
from swarm_mj.policies.policy_folder import (
    CARD,
    CONFIG,
    MLP_FORMAT,
    WAY_OUT,
    WEIGHTS,
    check_tensors,
    kind_of_tensor,
    present_policy,
    read_part,
    write_policy,
)
from swarm_mj.system.reading import read_document

VERSION = 1


@dataclass(frozen=True, kw_only=True)
class MlpConfig:
    """All of a plain network but its weights."""

    network: MlpShape
    training: dict[str, Any]  # JSON: what is known of how it was trained
    version: str  # of swarm_mj that stored it


def save_mlp(folder: Path, weights: Weights, config: MlpConfig) -> None:
    """Write a plain network as a policy, whole or not at all; a policy there is replaced.

    Raises:
        ValueError: `load_mlp` would not take it, or the folder holds other files than a policy's.
        OSError: The folder cannot be written.
    """
    _check(weights, config.network)
    document = {"format": MLP_FORMAT, "format_version": VERSION, **asdict(config)}
    contents = {
        WEIGHTS: save({name: np.ascontiguousarray(each) for name, each in weights.items()}),
        CONFIG: (json.dumps(document, indent=2, allow_nan=False) + "\n").encode(),
        CARD: mlp_card(config.network, config.training, config.version).encode(),
    }
    write_policy(folder, contents, check=read_mlp)


def read_mlp(folder: Path) -> tuple[Weights, MlpConfig]:
    """Return a plain network's weights and config.

    Raises:
        ValueError: There is none, or it is damaged, foreign, oversized or of a newer version.
        OSError: It cannot be read.
    """
    present, name = present_policy(folder), CONFIG
    try:
        config = read_document(read_part(present, name), MLP_FORMAT, VERSION, MlpConfig)
        name = WEIGHTS
        weights = _weights(read_part(present, name))
        _check(weights, config.network)
    except ValueError as error:
        raise ValueError(f"{folder / name}: {error}; {WAY_OUT}") from error
    return weights, config


def load_mlp(
    folder: Path,
    mission: Mission,
    *,
    is_deterministic: bool = False,
    features: Sequence[str] = (),
) -> MlpPolicy:
    """Return a plain network, ready to fly a mission with as many robots as it was trained on.

    Feature sets of one's own are imported only if their names are among `features`.

    Raises:
        ValueError: The mission has another number of robots, or the features are not those that
            may be imported; else as `read_mlp`.
        OSError: It cannot be read.
    """
    weights, config = read_mlp(folder)
    shape, size = config.network, config.network.num_robots
    if mission.num_robots != size:
        raise ValueError(
            f"policy {folder} flies teams of {size} robots, for which it was trained, not "
            f"{mission.num_robots}; choose --robots {size}"
        )
    extractor = trained_extractor(
        shape.features, shape.num_features, mission, named=features, where=f"policy {folder}"
    )
    return MlpPolicy(shape, weights, extractor, is_deterministic=is_deterministic)


def _weights(data: bytes) -> Weights:
    try:
        return load(data)
    except (SafetensorError, AssertionError, KeyError, RuntimeError, ValueError) as error:
        raise ValueError(f"it is damaged, or no safetensors file ({error})") from error


def _check(weights: Weights, shape: MlpShape) -> None:
    """Raise ValueError unless these are the weights of a network of that shape, all finite."""
    expected = {name: kind_of_tensor(size, "float32") for name, size in shape.tensors().items()}
    check_tensors(expected, weights, lambda values: np.all(np.isfinite(values)))
