"""A policy on disk: a folder of its weights, what they belong to, and a card for its reader."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save

from swarm_mj.gnn.fast import FastAggregationGnn
from swarm_mj.gnn.feature_sets import is_own_set, trained_extractor
from swarm_mj.gnn.network import AggregationGnn
from swarm_mj.mission import Mission
from swarm_mj.policies.gnn import LearnedPolicy
from swarm_mj.policies.model_card import model_card
from swarm_mj.policies.policy_config import PolicyConfig, from_json, to_json
from swarm_mj.policies.policy_folder import (
    CARD,
    CONFIG,
    WAY_OUT,
    WEIGHTS,
    check_tensors,
    kind_of_tensor,
    present_policy,
    read_part,
    write_policy,
)


def save_policy(
    folder: Path, network: AggregationGnn, config: PolicyConfig, card: str | None = None
) -> None:
    """Writes a policy, whole or not at all; whoever is killed leaves the old one or the new one.

    A policy there is replaced; the card is `model_card` of the config unless given.

    Raises:
        ValueError: `load_policy` would not take it, or the folder holds other files than a
            policy's.
        OSError: The folder cannot be written.
    """
    if config.network != network.shape:
        raise ValueError(f"config describes {config.network}, but the network is {network.shape}")
    tensors = {name: t.detach().cpu().contiguous() for name, t in network.state_dict().items()}
    _check(tensors, _empty(config))
    contents = {
        WEIGHTS: save(tensors),
        CONFIG: to_json(config).encode(),
        CARD: (model_card(config) if card is None else card).encode(),
    }
    write_policy(folder, contents, check=read_policy)


def load_policy(
    folder: Path,
    mission: Mission,
    *,
    is_deterministic: bool = False,
    features: Sequence[str] = (),
) -> LearnedPolicy:
    """A policy, ready to fly a mission, which may be of another kind than it was trained on.

    The mission's area, duration and range normalise what the robots see. A deterministic policy
    takes the most probable recipient instead of a draw. Feature sets of one's own are imported only
    if their names, as `module:Name`, are among `features`: the folder cannot make us run code.

    Raises:
        ValueError: There is none, or it is damaged, foreign, oversized or of a newer version, or
            its features are not those that may be imported.
        OSError: It cannot be read.
    """
    network, config = read_policy(folder)
    extractor = trained_extractor(
        config.features,
        config.network.num_features,
        mission,
        named=features,
        where=f"policy {folder}",
    )
    return LearnedPolicy(
        network,
        extractor,
        silence_logit=config.silence_logit,
        is_deterministic=is_deterministic,
        own_features=config.features if is_own_set(config.features) else None,
    )


def read_policy(folder: Path) -> tuple[AggregationGnn, PolicyConfig]:
    """A policy's network, with its weights, and its config; errors as of `load_policy`."""
    present = present_policy(folder)
    name = CONFIG
    try:
        config = from_json(read_part(present, name))
        name = WEIGHTS
        return _network(config, read_part(present, name)), config
    except ValueError as error:
        raise ValueError(f"{folder / name}: {error}; {WAY_OUT}") from error


def _network(config: PolicyConfig, data: bytes) -> AggregationGnn:
    """The network with the weights of a safetensors file."""
    try:
        tensors = {name: tensor.clone() for name, tensor in load(data).items()}
    except (SafetensorError, AssertionError, KeyError, RuntimeError, ValueError) as error:
        raise ValueError(f"it is damaged, or no safetensors file ({error})") from error
    network = _empty(config)
    _check(tensors, network)
    network.load_state_dict(tensors, assign=True)
    return network


def _empty(config: PolicyConfig) -> AggregationGnn:
    """The network without weights: it takes no memory, and draws no random numbers."""
    with torch.device("meta"):
        return FastAggregationGnn(config.network)


def _check(tensors: Mapping[str, torch.Tensor], network: AggregationGnn) -> None:
    """Raises ValueError unless these are a network's tensors, all of them finite."""
    expected = {n: kind_of_tensor(t.shape, t.dtype) for n, t in network.state_dict().items()}
    check_tensors(expected, tensors, lambda tensor: torch.isfinite(tensor).all())
