"""A policy on disk: one `.safetensors` file of weights, whose metadata says what they belong to.

Nothing in such a file is code: no pickle, no name that would be imported. The metadata has one
entry, JSON, of the format, its version, the kind of the network, the config and the card.
"""

import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from swarm_mj.mission import Mission
from swarm_mj.policies.gnn import feature_sets
from swarm_mj.policies.learned import LearnedPolicy, MlpPolicy
from swarm_mj.policies.policy_config import SUFFIX, GnnConfig, MlpConfig, Weights, model_card
from swarm_mj.system.packages import need
from swarm_mj.system.reading import check_size, open_file, read_document, read_plain
from swarm_mj.system.writing import write_bytes

if TYPE_CHECKING:  # a plain network flies without torch, so functions import it
    from swarm_mj.policies.gnn.network import AggregationGnn

POLICY = f"policy{SUFFIX}"  # the policy of a run, in its folder
FORMAT, VERSION = "swarm_mj policy", 2  # and the metadata's entry; version 1 was a folder
CONFIGS = {"gnn": GnnConfig, "mlp": MlpConfig}
MAX_BYTES = 64_000_000
WAY_OUT = "copy it again, or make one with `swarm-mj train`"


@dataclass(frozen=True, kw_only=True)
class _Metadata:
    kind: Literal["gnn", "mlp"]
    config: dict[str, Any]
    card: str


def save_gnn(
    path: Path, network: "AggregationGnn", config: GnnConfig, card: str | None = None
) -> Path:
    """Store a GNN, as `save_weights` does."""
    weights = {name: t.detach().cpu().numpy() for name, t in network.state_dict().items()}
    return save_weights(path, weights, config, card)


def save_weights(
    path: Path, weights: Weights, config: GnnConfig | MlpConfig, card: str | None = None
) -> Path:
    """Store a policy, whole or not at all; return its file, which replaces one of that name.

    `.safetensors` is appended unless the path ends so. The card, in Markdown, is `model_card` of
    the config unless given. Raises ValueError for weights that `load_policy` would not take, or a
    file too large, TypeError or ValueError for a config that is no JSON, OSError if the file cannot
    be written.
    """
    path = path if path.suffix == SUFFIX else Path(f"{path}{SUFFIX}")
    _check_tensors(config, path, weights)
    (kind,) = (name for name, its in CONFIGS.items() if isinstance(config, its))
    said = {"format": FORMAT, "format_version": VERSION, "kind": kind, "config": asdict(config)}
    text = json.dumps(said | {"card": card or model_card(config)}, allow_nan=False)
    # In one entry: safetensors would write several in another order every time.
    data = save({n: np.ascontiguousarray(w) for n, w in weights.items()}, {FORMAT: text})
    check_size(path.name, len(data), MAX_BYTES)
    write_bytes(path, data)
    return path


def load_policy(
    path: Path, mission: Mission, *, is_deterministic: bool = False, features: Sequence[str] = ()
) -> LearnedPolicy:
    """Return a policy, ready to fly a mission, which may be of another kind than it was trained on.

    The mission's area, duration and range normalise what the robots see. A deterministic policy
    takes the most probable recipient instead of a draw. Users' own feature sets are imported only
    if their names, as `module:Name`, are among `features`: a policy cannot make us run code. Errors
    are those of `read_weights`, and ValueError if it flies teams of another size, or its features
    are none that may be imported, or now have another number.
    """
    weights, config = read_weights(path)
    size = config.network.num_robots if isinstance(config, MlpConfig) else mission.num_robots
    if mission.num_robots != size:
        raise ValueError(
            f"policy {path} flies teams of {size} robots, for which it was trained, not "
            f"{mission.num_robots}; choose --robots {size}"
        )
    seen, num_trained_on = config.features, config.network.num_features
    feature_sets.check_named(seen, features, f"policy {path}")
    own = seen if feature_sets.is_own_set(seen) else ""
    if own:
        feature_sets.load_features(own)
    if (num := feature_sets.num_features(seen)) != num_trained_on:
        raise ValueError(
            f"policy {path} was trained on {num_trained_on} features, and {seen} now has {num}"
        )
    extractor = feature_sets.make_extractor(seen, mission)
    options: Any = {"is_deterministic": is_deterministic, "own_features": own}
    if isinstance(config, MlpConfig):
        return MlpPolicy(config.network, weights, extractor, **options)
    from swarm_mj.policies.gnn.fast import network_of
    from swarm_mj.policies.gnn.policy import GnnPolicy

    network = network_of(config.network, weights)
    return GnnPolicy(network, extractor, config.silence_logit, **options)


def read_policy(path: Path) -> tuple["AggregationGnn", GnnConfig]:
    """Return a GNN, with its weights, and its config; errors as of `read_weights`."""
    weights, config = read_weights(path)
    if not isinstance(config, GnnConfig):
        raise ValueError(f"policy {path} is a plain network; name one that `swarm-mj train` made")
    from swarm_mj.policies.gnn.fast import network_of

    return network_of(config.network, weights), config


def read_weights(path: Path) -> tuple[Weights, GnnConfig | MlpConfig]:
    """Return a policy's weights, each of them checked, and its config.

    Raises ValueError if there is no policy, or it is damaged, foreign, oversized or of a newer
    version, OSError if it cannot be read.
    """
    place = find_policy(path)
    try:
        weights, metadata = _read_tensors(place)
        if FORMAT not in metadata:
            raise ValueError("it has weights, but does not say of which policy")
        said = read_document(metadata[FORMAT], FORMAT, VERSION, _Metadata)
        config = read_plain(said.config, CONFIGS[said.kind])
        _check_tensors(config, path, weights)
    except ValueError as error:
        raise ValueError(f"policy {place}: {error}; {WAY_OUT}") from error
    return weights, config


def find_policy(path: Path) -> Path:
    """Return the file `path`, `path.safetensors` or that in a run's folder; ValueError for none."""
    for place in (path, Path(f"{path}{SUFFIX}"), path / POLICY):
        if os.path.isfile(place):
            return place
    found = sorted({*path.glob(f"*{SUFFIX}"), *path.glob(f"*/{POLICY}")})
    if found:
        raise ValueError(f"{path} holds policies; name one of them: {', '.join(map(str, found))}")
    raise ValueError(
        f"there is no policy {path}; name a {SUFFIX} file, or the folder of a run that "
        "`swarm-mj train` wrote, such as runs/NAME"
    )


def _read_tensors(path: Path) -> tuple[Weights, dict[str, str]]:
    with open_file(path, "policy") as file:  # which refuses pipes; `safe_open` would wait for them
        check_size(f"policy {path}", os.fstat(file.fileno()).st_size, MAX_BYTES)
    try:
        with safe_open(path, "numpy") as file:
            names = file.keys()  # it is no mapping
            return {name: file.get_tensor(name) for name in names}, file.metadata() or {}
    # The last two: no type of NumPy's.
    except (SafetensorError, AttributeError, TypeError) as error:
        raise ValueError(f"it is damaged, or no safetensors file ({error})") from error


def _check_tensors(config: GnnConfig | MlpConfig, path: Path, tensors: Weights) -> None:
    """Raise ValueError unless these are a network's tensors, single-precision and finite."""
    if isinstance(config, MlpConfig):
        shapes = config.network.tensors
    else:
        need("torch", f"policy {path}", "fly another")
        from swarm_mj.policies.gnn.fast import empty_network

        shapes = {n: tuple(x.shape) for n, x in empty_network(config.network).state_dict().items()}
    for name in sorted(shapes.keys() ^ tensors.keys()):
        known = "lacks the" if name in shapes else "has an unknown"
        raise ValueError(f"it {known} tensor {name:.80}")
    for name, tensor in tensors.items():
        given, wanted = (tensor.shape, tensor.dtype), (shapes[name], np.float32)
        if given != wanted:
            must, found = (f"{list(shape)} of {np.dtype(kind)}" for shape, kind in (wanted, given))
            raise ValueError(f"tensor {name} must be {must}, not {found}")
        if not np.all(np.isfinite(tensor)):
            raise ValueError(f"tensor {name} has numbers that are not finite")
