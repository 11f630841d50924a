"""A policy on disk: one `.safetensors` file of weights, whose metadata says what they belong to.

Nothing in such a file is code: no pickle, no name that would be imported. The metadata has one
entry, JSON, of the format, its version, the kind of the network, the names of its features in
order, the config and the card.
"""

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from swarm_mj.mission import Mission
from swarm_mj.policies.gnn import feature_sets
from swarm_mj.policies.gnn.policy import GnnPolicy, StoredGnn
from swarm_mj.policies.index.policy import IndexCsma
from swarm_mj.policies.index.weights import FEATURES, from_tensors
from swarm_mj.policies.learned import LearnedPolicy, MlpPolicy
from swarm_mj.policies.policy_config import (
    SUFFIX,
    GnnConfig,
    IndexConfig,
    MlpConfig,
    StoredConfig,
    Tensors,
    model_card,
)
from swarm_mj.system.packages import need
from swarm_mj.system.reading import check_size, open_file, read_document, read_plain
from swarm_mj.system.writing import write_bytes

if TYPE_CHECKING:  # policies are loaded without torch, which takes seconds to import
    from swarm_mj.policies.gnn.network import Network

POLICY = f"policy{SUFFIX}"  # the policy of a run, in its folder
FORMAT = "swarm_mj policy"  # and the metadata's entry
VERSION = 3  # 2, of swarm_mj 1.0.0, did not name the features
CONFIGS: dict[str, type[StoredConfig]] = {
    "gnn": GnnConfig,
    "mlp": MlpConfig,
    "index": IndexConfig,
}
MAX_BYTES = 64_000_000
WAY_OUT = "copy it again, or make one with `swarm-mj train`"


@dataclass(frozen=True, kw_only=True)
class _Metadata:
    """The entry of the metadata, without its format and version."""

    kind: Literal["gnn", "mlp", "index"]
    config: dict[str, Any]
    card: str
    feature_names: tuple[str, ...]  # in order; none in files of 1.0.0

    @property
    def feature_set(self) -> str:
        """The name of the feature set, or "" for a config that has none, and so is unsound."""
        # The config is not checked yet. A GNN's names its features itself, perceptrons' their
        # network does.
        network = self.config.get("network")
        of_network = network.get("features") if isinstance(network, dict) else None
        features = self.config.get("features", of_network)
        return features if isinstance(features, str) else ""


def save_gnn(path: Path, network: "Network", config: GnnConfig, card: str | None = None) -> Path:
    """Store a GNN whole or not at all.

    Args:
        path: The file, which replaces one of that name; `.safetensors` is appended unless it ends
            so.
        network: Its weights, on any device.
        config: Its shape, the feature set that it was trained on, and its origin.
        card: A text in Markdown that the file holds, too; `model_card` of the config unless given.

    Returns:
        The file.

    Raises:
        ValueError: `load_policy` would not take the weights, the config is no JSON, or the file
            would be too large.
        TypeError: The config is no JSON.
        OSError: The file cannot be written.

    Example:
        >>> save_gnn(Path("mine"), network, config)
        PosixPath('mine.safetensors')
    """
    weights = {name: t.detach().cpu().numpy() for name, t in network.state_dict().items()}
    return save_weights(path, weights, config, card)


def save_weights(
    path: Path, weights: Tensors, config: StoredConfig, card: str | None = None
) -> Path:
    """Store a policy's weights by name, as `save_gnn` does; it returns and raises the same."""
    path = path if path.suffix == SUFFIX else Path(f"{path}{SUFFIX}")
    _check_weights(config, weights)
    said = {
        "format": FORMAT,
        "format_version": VERSION,
        "kind": _kind_of(config),
        "feature_names": _features_of(config),
        "config": asdict(config),
        "card": card or model_card(config),
    }
    tensors = {name: np.ascontiguousarray(weight) for name, weight in weights.items()}
    # In one entry: safetensors would write several in another order every time.
    data = save(tensors, {FORMAT: json.dumps(said, allow_nan=False)})
    check_size(path.name, len(data), MAX_BYTES)
    write_bytes(path, data)
    return path


def _kind_of(config: StoredConfig) -> str:
    """Return what the metadata calls a kind of policy."""
    [kind] = [name for name, its in CONFIGS.items() if isinstance(config, its)]
    return kind


def _features_of(config: StoredConfig) -> Sequence[str]:
    """Return the names of a policy's features, in order; none of a user's own that is unknown."""
    if isinstance(config, IndexConfig):
        return FEATURES
    return feature_sets.known_names(config.features)


def load_policy(
    path: Path,
    mission: Mission,
    *,
    is_deterministic: bool = False,
    features: Sequence[str] = (),
    networks: Sequence[str] = (),
) -> LearnedPolicy | IndexCsma:
    """Return a stored policy, ready to fly.

    Args:
        path: Its file, with or without `.safetensors`, or the folder of a run.
        mission: What it flies, which may be of another kind than it was trained on. Its area,
            duration and range normalise what the robots see.
        is_deterministic: Whether robots take the most probable recipient instead of a draw.
        features: Users' own feature sets, as `module:Name`, that may be imported. A policy names
            the one it was trained on, but only the user can make us run code.
        networks: Users' own networks, as `module:Name`, likewise.

    Returns:
        The policy; a graph neural network imports torch when it flies first.

    Raises:
        ValueError: There is no policy; it is damaged, foreign, oversized or of a newer version; it
            flies teams of another size; its features are a user's own and not among `features`, nor
            its network among `networks`; or they are other ones now than it was trained on.
        ModuleNotFoundError: It is a graph neural network, and torch is not installed.
        OSError: It cannot be read.

    Example:
        >>> policy = load_policy(Path("runs/mine"), paper("random-walk", num_robots=20))
        >>> run = swarm_mj.fly("random-walk", policy=policy, num_robots=20)
    """
    weights, config, feature_names = _read(path)
    if isinstance(config, IndexConfig):
        if is_deterministic:
            raise ValueError(
                f"policy {path} holds numbers of index-csma, which draw no recipient; leave out "
                "--deterministic"
            )
        return IndexCsma(mission, from_tensors(weights))
    if isinstance(config, MlpConfig) and mission.num_robots != config.network.num_robots:
        size = config.network.num_robots
        raise ValueError(
            f"policy {path} flies teams of {size} robots, for which it was trained, not "
            f"{mission.num_robots}; choose --robots {size}"
        )
    seen = config.features
    own = ""
    if feature_sets.is_own_set(seen):
        own = seen
        feature_sets.check_named(own, features, f"policy {path}")
        feature_sets.load_features(own)
        feature_sets.check_unchanged(own, feature_names, f"policy {path}")
    num_trained_on = config.network.num_features
    num_now = feature_sets.num_features(seen)
    if num_now != num_trained_on:  # in files of 1.0.0, which name no features
        raise ValueError(
            f"policy {path} was trained on {num_trained_on} features, and {seen} now has {num_now}"
        )
    extractor = feature_sets.make_extractor(seen, mission)
    if isinstance(config, MlpConfig):
        return MlpPolicy(
            config.network,
            weights,
            extractor,
            is_deterministic=is_deterministic,
            own_features=own,
        )
    need("torch", f"policy {path}", "fly another")
    _load_network(config, weights, networks, path)
    return GnnPolicy(
        StoredGnn(shape=config.network, weights=weights, own=config.own_network),
        extractor,
        config.silence_logit,
        most_speech=config.most_speech,
        is_deterministic=is_deterministic,
        own_features=own,
    )


def _load_network(
    config: GnnConfig, weights: Tensors, networks: Sequence[str] | None, path: Path
) -> None:
    """Load a policy's network if it is a user's own; raise ValueError if it may not be, or differs.

    `networks` are those that may be imported; None imports nothing, and takes what is loaded.
    """
    own = config.own_network
    if not own:
        return
    from swarm_mj.policies.gnn import own_networks  # torch is slow to import

    if networks is not None:
        own_networks.check_named(own, networks, f"policy {path}")
        own_networks.load_network(own)
    with _as_unsound(path):
        _check_tensors(own_networks.tensors_of(config.network, own), weights)


def read_policy(path: Path) -> tuple["Network", GnnConfig]:
    """Return a GNN, with its weights, and its config.

    A network of a user's own must have been loaded, by `own_networks.load_network`. Raises errors
    as `read_weights` does, and ValueError for a policy that is no GNN.
    """
    weights, config = read_weights(path)
    if not isinstance(config, GnnConfig):
        kind = "a plain network" if isinstance(config, MlpConfig) else "an index"
        raise ValueError(f"policy {path} is {kind}; name one that `swarm-mj train` made")
    from swarm_mj.policies.gnn.own_networks import network_of

    _load_network(config, weights, None, path)
    return network_of(config.network, weights, config.own_network), config


def read_weights(path: Path) -> tuple[Tensors, StoredConfig]:
    """Return a policy's weights, each of them checked, and its config.

    Raises ValueError if there is no policy, or it is damaged, foreign, oversized or of a newer
    version, or our features are others now or in another order, OSError if it cannot be read.
    """
    weights, config, _ = _read(path)
    return weights, config


def _read(path: Path) -> tuple[Tensors, StoredConfig, tuple[str, ...]]:
    """Return a policy's weights, its config and the names of its features."""
    place = find_policy(path)
    with _as_unsound(place):
        weights, metadata = _read_tensors(place)
        if FORMAT not in metadata:
            raise ValueError("it has weights, but does not say of which policy")
        document: dict[str, Any] = read_document(metadata[FORMAT], FORMAT, VERSION, dict)
        said = read_plain({"feature_names": (), **document}, _Metadata)
    # Before the config, whose number of features would say less.
    if said.kind == "index":
        if said.feature_names != FEATURES:
            raise ValueError(
                f"policy {place} was trained on other features than index-csma has now; train anew"
            )
    else:
        feature_sets.check_unchanged(said.feature_set, said.feature_names, f"policy {place}")
    with _as_unsound(place):
        config = read_plain(said.config, CONFIGS[said.kind])
        _check_weights(config, weights)
    return weights, config, said.feature_names


@contextmanager
def _as_unsound(place: Path) -> Iterator[None]:
    """Let a ValueError name the policy and the way out."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"policy {place}: {error}; {WAY_OUT}") from error


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


def _read_tensors(path: Path) -> tuple[Tensors, dict[str, str]]:
    with open_file(path, "policy") as file:  # which refuses pipes; `safe_open` would wait for them
        check_size(f"policy {path}", os.fstat(file.fileno()).st_size, MAX_BYTES)
    try:
        with safe_open(path, "numpy") as file:
            names = file.keys()  # it is no mapping
            return {name: file.get_tensor(name) for name in names}, file.metadata() or {}
    # The last two: no type of NumPy's.
    except (SafetensorError, AttributeError, TypeError) as error:
        raise ValueError(f"it is damaged, or no safetensors file ({error})") from error


def _check_weights(config: StoredConfig, weights: Tensors) -> None:
    """Raise ValueError unless weights are a config's, as far as is known without running code."""
    if isinstance(config, GnnConfig) and config.own_network:
        # Their shapes only the code of its user knows.
        shapes = {name: tensor.shape for name, tensor in weights.items()}
        _check_tensors(shapes, weights)
    elif isinstance(config, IndexConfig):
        _check_tensors(config.tensors, weights)
    else:
        _check_tensors(config.network.tensors, weights)


def _check_tensors(shapes: dict[str, tuple[int, ...]], tensors: Tensors) -> None:
    """Raise ValueError unless these are a network's tensors, single-precision and finite."""
    for name in sorted(shapes.keys() ^ tensors.keys()):
        known = "lacks the" if name in shapes else "has an unknown"
        raise ValueError(f"it {known} tensor {name:.80}")
    for name, tensor in tensors.items():
        shape = shapes[name]
        if tensor.shape != shape or tensor.dtype != np.float32:
            raise ValueError(
                f"tensor {name} must be {list(shape)} of float32, not {list(tensor.shape)} of "
                f"{tensor.dtype}"
            )
        if not np.all(np.isfinite(tensor)):
            raise ValueError(f"tensor {name} has numbers that are not finite")
