"""From the network's numbers to logits over recipients (III-C)."""

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from swarm_mj.policies.gnn.graphs import Graphs
from swarm_mj.policies.gnn.network import Network
from swarm_mj.policies.learned import IMPOSSIBLE
from swarm_mj.policies.policy_config import NO_BOUND


def network_logits(
    network: Network,
    graphs: Graphs,
    *,
    silence_logit: float,
    most_speech: float = NO_BOUND,
    memory: Float[np.ndarray, "R H"] | None = None,
) -> tuple[Float[np.ndarray, "R N"], Float[np.ndarray, "R H"] | None]:
    """Return each robot's logits over recipients, row by row, from its own graph.

    And what it remembers from now on, if it remembers anything: `memory` is of before.
    """
    num_rows, num_robots = graphs.may_address.shape
    node = torch.from_numpy(graphs.node)
    parent = torch.from_numpy(graphs.parent.astype(np.int64))  # a copy: buffers are read-only
    may_address = torch.from_numpy(graphs.may_address)
    owner = torch.arange(num_rows) % num_robots
    device = next(network.parameters()).device
    with single_thread(), torch.inference_mode():
        remembered = None if memory is None else torch.from_numpy(memory).to(device)
        seen = (node.to(device), parent.to(device))
        output, remembered = evaluated(
            network, *seen, may_address.to(device), owner.to(device), remembered
        )
        logits = recipient_logits(
            output.cpu(),
            owner=owner,
            may_address=may_address,
            silence_logit=silence_logit,
            most_speech=most_speech,
            has_turn=torch.from_numpy(graphs.has_turn),
        ).numpy()
        return logits, None if remembered is None else remembered.cpu().numpy()


@contextmanager
def single_thread() -> Iterator[None]:
    """Let torch compute on one thread within it: small batches are slower on several."""
    num_threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(num_threads)  # the setting is the process's


def evaluated(
    network: Network,
    node: Float[Tensor, "R N F"],
    parent: Int[Tensor, "R N"],
    is_wanted: Bool[Tensor, "R N"],
    owner: Int[Tensor, "R"],
    memory: Float[Tensor, "R H"] | None,
) -> tuple[Float[Tensor, "R N O"], Float[Tensor, "R H"] | None]:
    """Return a network's numbers for each node, and what robots remember from now on, if anything.

    Raises ValueError if a network of a user's own returns other shapes.
    """
    if memory is None:
        output = network(node, parent, is_wanted)
    else:
        before = memory.shape
        memory = network.remember(node, parent, owner, memory)
        _check_shape(network, "remember", memory, tuple(before))
        output = network(node, parent, is_wanted, memory)
    _check_shape(network, "forward", output, (*parent.shape, network.shape.num_outputs))
    return output, memory


def _check_shape(network: Network, what: str, found: object, shape: tuple[int, ...]) -> None:
    its = tuple(found.shape) if isinstance(found, Tensor) else type(found).__name__
    if its != shape:
        name = type(network).__name__
        raise ValueError(f"{name}.{what} must return a tensor of shape {shape}, not {its}")


def recipient_logits(
    output: Float[Tensor, "R N O"],
    owner: Int[Tensor, "R"],
    may_address: Bool[Tensor, "R N"],
    silence_logit: float = 0.0,
    has_turn: Bool[Tensor, "R"] | None = None,
    most_speech: float = NO_BOUND,
) -> Float[Tensor, "R N"]:
    """Return each robot's logits over recipients; oneself is silence (III-C).

    With one number per node it is the node's logit. With two, as in the authors' code, they are the
    logits of addressing it at full and at zero power; all that send nothing count together. Each
    row is of one robot, its `owner`, whose silence gains `silence_logit` unless it has a turn.
    Recipients that it may not address have `IMPOSSIBLE`; the owner always may. Without a turn it
    speaks with a probability of at most `most_speech`.
    """
    own = owner[:, None]
    logits, *others = output.unbind(dim=2)
    if others:  # the authors' second number: of sending at no power, hence of silence
        (zero_power,) = others
        zero_power = zero_power.masked_fill(~may_address, IMPOSSIBLE)
        unsent = torch.cat([zero_power, logits.gather(1, own)], dim=1)
        logits = logits.scatter(1, own, torch.logsumexp(unsent, dim=1, keepdim=True))
    if silence_logit:
        bias = torch.full_like(own, silence_logit, dtype=logits.dtype)
        if has_turn is not None:
            bias = bias.masked_fill(has_turn[:, None], 0.0)
        logits = logits.scatter_add(1, own, bias)
    logits = logits.masked_fill(~may_address, IMPOSSIBLE)
    if most_speech == NO_BOUND:
        return logits
    return _bounded(logits, own, most_speech, has_turn)


def _bounded(
    logits: Float[Tensor, "R N"],
    own: Int[Tensor, "R 1"],
    most_speech: float,
    has_turn: Bool[Tensor, "R"] | None,
) -> Float[Tensor, "R N"]:
    """Return logits with which robots speak no more often than they may.

    The likeliest failure of a small team is a jam that locks in: who hears nothing has old news,
    thinks that it is due, and speaks. Credit hardly unlearns that, as in a jam nobody alone changes
    anything. So the bound holds whatever the network says, and the recipients of those who do speak
    stay as likely among themselves.
    """
    silence = logits.gather(1, own)
    speech = logits.scatter(1, own, IMPOSSIBLE).logsumexp(dim=1, keepdim=True)
    least = speech + math.log(1.0 / most_speech - 1.0)
    if has_turn is not None:
        least = least.masked_fill(has_turn[:, None], IMPOSSIBLE)
    return logits.scatter(1, own, torch.maximum(silence, least))
