"""A policy on disk: a folder of weights, what they belong to, and a card; or all in one file."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save

from swarm_mj.mission import Mission
from swarm_mj.policies.gnn.fast import FastAggregationGnn
from swarm_mj.policies.gnn.feature_sets import is_own_set, trained_extractor
from swarm_mj.policies.gnn.network import AggregationGnn
from swarm_mj.policies.gnn.policy import LearnedPolicy
from swarm_mj.policies.model_card import model_card
from swarm_mj.policies.policy_config import PolicyConfig, from_json, to_json
from swarm_mj.policies.policy_folder import (
    CARD,
    CONFIG,
    MAX_BYTES,
    ONE_FILE,
    WAY_OUT,
    WEIGHTS,
    check_tensors,
    kind_of_tensor,
    metadata_of,
    present_policy,
    read_part,
    write_policy,
)
from swarm_mj.system.atomic import write_bytes
from swarm_mj.system.reading import check_size, read_file, read_json

METADATA = "swarm_mj policy"  # the entry of a one-file policy's metadata that has config and card


def save_policy(
    path: Path, network: AggregationGnn, config: PolicyConfig, card: str | None = None
) -> None:
    """Write a policy, whole or not at all; whoever is killed leaves the old one or the new one.

    A policy there is replaced; the card is `model_card` of the config unless given. A path that
    ends in `.safetensors` becomes one file, any other a folder.

    Raises:
        ValueError: `load_policy` would not take it, or the folder holds other files than a
            policy's.
        OSError: The path cannot be written.
    """
    if config.network != network.shape:
        raise ValueError(f"config describes {config.network}, but the network is {network.shape}")
    tensors = {name: t.detach().cpu().contiguous() for name, t in network.state_dict().items()}
    _check(tensors, _empty(config))
    text, card = to_json(config), model_card(config) if card is None else card
    if path.suffix == ONE_FILE:
        # In one entry: several would be in another order every time.
        data = save(tensors, {METADATA: json.dumps({CONFIG: text, CARD: card})})
        check_size(path.name, len(data), MAX_BYTES[WEIGHTS])
        write_bytes(path, data, check=_read_file)
        return
    contents = {WEIGHTS: save(tensors), CONFIG: text.encode(), CARD: card.encode()}
    write_policy(path, contents, check=read_policy)


def load_policy(
    path: Path,
    mission: Mission,
    *,
    is_deterministic: bool = False,
    features: Sequence[str] = (),
) -> LearnedPolicy:
    """Return a policy, ready to fly a mission, which may be of another kind than it was trained on.

    The mission's area, duration and range normalise what the robots see. A deterministic policy
    takes the most probable recipient instead of a draw. Feature sets of one's own are imported only
    if their names, as `module:Name`, are among `features`: a policy cannot make us run code.

    Raises:
        ValueError: There is none, or it is damaged, foreign, oversized or of a newer version, or
            its features are not those that may be imported.
        OSError: It cannot be read.
    """
    network, config = read_policy(path)
    extractor = trained_extractor(
        config.features,
        config.network.num_features,
        mission,
        named=features,
        where=f"policy {path}",
    )
    return LearnedPolicy(
        network,
        extractor,
        silence_logit=config.silence_logit,
        is_deterministic=is_deterministic,
        own_features=config.features if is_own_set(config.features) else None,
    )


def read_policy(path: Path) -> tuple[AggregationGnn, PolicyConfig]:
    """Return a policy's network, with its weights, and its config; errors as of `load_policy`."""
    present = present_policy(path)
    if present.is_file():
        try:
            return _read_file(present)
        except ValueError as error:
            raise ValueError(f"{path}: {error}; {WAY_OUT}") from error
    name = CONFIG
    try:
        config = from_json(read_part(present, name))
        name = WEIGHTS
        return _network(config, read_part(present, name)), config
    except ValueError as error:
        raise ValueError(f"{path / name}: {error}; {WAY_OUT}") from error


def _read_file(path: Path) -> tuple[AggregationGnn, PolicyConfig]:
    """As `read_policy`, of one file, whose metadata is in the JSON at its head."""
    data = read_file(path, "policy", MAX_BYTES[WEIGHTS])
    about = metadata_of(data)
    try:
        config = from_json(read_json(about[METADATA], dict)[CONFIG])
    except (KeyError, TypeError) as error:
        raise ValueError(
            "it has weights, but does not say of which policy; if a policy's folder holds it, "
            "name that"
        ) from error
    return _network(config, data), config


def _network(config: PolicyConfig, data: bytes) -> AggregationGnn:
    """Return the network with the weights of a safetensors file."""
    try:
        tensors = {name: tensor.clone() for name, tensor in load(data).items()}
    except (SafetensorError, AssertionError, KeyError, RuntimeError, ValueError) as error:
        raise ValueError(f"it is damaged, or no safetensors file ({error})") from error
    network = _empty(config)
    _check(tensors, network)
    network.load_state_dict(tensors, assign=True)
    return network


def _empty(config: PolicyConfig) -> AggregationGnn:
    """Return the network without weights: it takes no memory, and draws no random numbers."""
    with torch.device("meta"):
        return FastAggregationGnn(config.network)


def _check(tensors: Mapping[str, torch.Tensor], network: AggregationGnn) -> None:
    """Raise ValueError unless these are a network's tensors, all of them finite."""
    expected = {n: kind_of_tensor(t.shape, t.dtype) for n, t in network.state_dict().items()}
    check_tensors(expected, tensors, lambda tensor: torch.isfinite(tensor).all())
