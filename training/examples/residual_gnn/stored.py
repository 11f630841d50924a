"""A network's weights in one safetensors file, with what they belong to in its metadata."""

import json
from pathlib import Path

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from residual_gnn.network import Weights, shapes
from swarm_mj.system.writing import write_bytes

FORMAT = "swarm_mj residual policy"  # the entry of the metadata that describes the weights
SHIPPED = Path(__file__).with_name("weights.safetensors")


def save_weights(path: Path, weights: Weights, card: str) -> None:
    """Write weights and a model card as one file, whole or not at all.

    Raises:
        OSError: The file cannot be written.
    """
    about = {
        "width": weights.width,
        "prior_logit": weights.prior_logit,
        "corrects_turns": weights.corrects_turns,
        "card": card,
    }
    arrays = {name: np.ascontiguousarray(each) for name, each in weights.arrays.items()}
    write_bytes(path, save(arrays, {FORMAT: json.dumps(about, allow_nan=False)}))


def load_weights(path: Path) -> Weights:
    """Read the weights in a file.

    Raises:
        ValueError: It is damaged, or holds another network.
        OSError: It cannot be read.
    """
    try:
        with safe_open(path, framework="np") as file:
            about = json.loads(file.metadata()[FORMAT])
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - no dict
    except (SafetensorError, KeyError, TypeError, json.JSONDecodeError) as error:
        raise ValueError(f"{path} holds no weights of this network ({error})") from error
    found = {name: array.shape for name, array in arrays.items()}
    if found != shapes(about["width"]):
        raise ValueError(f"{path} holds arrays of other shapes than this network's")
    return Weights(arrays, about["prior_logit"], about["corrects_turns"])
