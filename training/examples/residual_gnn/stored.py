"""Residual policies on disk: one file of weights, with what they are of in its metadata."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from residual_gnn.network import Weights, shapes
from swarm_mj.policies.policy_folder import check_tensors, kind_of_tensor, metadata_of
from swarm_mj.system.atomic import write_bytes
from swarm_mj.system.reading import check_size, read_document, read_file

FORMAT, VERSION = "swarm_mj residual policy", 1
METADATA = FORMAT  # the entry of the file's metadata that says what the weights are of
MOST_BYTES = 5_000_000
MOST_WIDTH, MOST_TRUST = 256, 50


@dataclass(frozen=True, kw_only=True)
class _About:
    """What the metadata says."""

    width: int
    trust: float
    corrects_turns: bool
    card: str


def save_residual(path: Path, weights: Weights, card: str) -> None:
    """Write weights and a card as one file, whole or not at all; a file there is replaced.

    Raises:
        ValueError: `read_residual` would not take it.
        OSError: The file cannot be written.
    """
    about = _About(
        width=weights.width,
        trust=weights.trust,
        corrects_turns=weights.corrects_turns,
        card=card,
    )
    document = {"format": FORMAT, "format_version": VERSION, **asdict(about)}
    arrays = {name: np.ascontiguousarray(each) for name, each in weights.arrays.items()}
    data = save(arrays, {METADATA: json.dumps(document, allow_nan=False)})
    check_size(path.name, len(data), MOST_BYTES)
    _weights(data, about)
    write_bytes(path, data, check=read_residual)


def is_residual(path: Path) -> bool:
    """Whether a file says that it holds such weights."""
    try:
        return METADATA in metadata_of(read_file(path, "policy", MOST_BYTES))
    except ValueError:  # it is a folder, or no such file; whoever reads it as another says more
        return False


def read_residual(path: Path) -> Weights:
    """Return the weights in a file.

    Raises:
        ValueError: There is no such file, or it is damaged, foreign, oversized or of a newer
            version.
        OSError: It cannot be read.
    """
    data = read_file(path, "policy", MOST_BYTES)
    try:
        about = read_document(metadata_of(data)[METADATA], FORMAT, VERSION, _About)
        return _weights(data, about)
    except KeyError as error:
        raise ValueError(f"policy {path} is no residual policy; name another file") from error
    except ValueError as error:
        raise ValueError(f"policy {path}: {error}; copy it again") from error


def _weights(data: bytes, about: _About) -> Weights:
    """Return the arrays, each checked."""
    if not 1 <= about.width <= MOST_WIDTH:
        raise ValueError(f"its width must be from 1 to {MOST_WIDTH}, not {about.width}")
    if not 0.0 <= about.trust <= MOST_TRUST:
        raise ValueError(f"its trust must be from 0 to {MOST_TRUST}, not {about.trust:g}")
    try:
        arrays = load(data)
    except (SafetensorError, KeyError, ValueError) as error:
        raise ValueError(f"it is damaged, or no safetensors file ({error})") from error
    single = np.dtype(np.float32)
    kinds = {name: kind_of_tensor(shape, single) for name, shape in shapes(about.width).items()}
    check_tensors(kinds, arrays, lambda array: np.isfinite(array).all())
    return Weights(arrays, about.trust, about.corrects_turns)
