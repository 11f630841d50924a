"""A learned policy: every robot's own network on its own buffer's graph (III-A to III-C)."""

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import torch
from jaxtyping import Float, Int

from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.policies.gnn.action_distribution import recipient_logits
from swarm_mj.policies.gnn.graphs import FeatureExtractor
from swarm_mj.policies.gnn.network import AggregationGnn
from swarm_mj.policies.gnn.sampling import sample
from swarm_mj.policies.policy import DecentralisedPolicy, Parameters
from swarm_mj.protocol.local_views import LocalViews

DIGITS = 12  # of a digest: enough to tell policies apart


class LearnedPolicy(DecentralisedPolicy):
    """Addresses whom the network's Boltzmann distribution draws, or its mode.

    The robots' networks are alike, so one batch evaluates all of them. It does so on one thread:
    small batches are slower on several, and processes share the work of many missions better.
    """

    def __init__(
        self,
        network: AggregationGnn,
        extractor: FeatureExtractor,
        *,
        silence_logit: float = 0.0,
        is_deterministic: bool = False,
        own_features: str | None = None,
    ) -> None:
        """Take the network as it is, live, on any device: later changes of its weights count.

        The extractor makes the graphs that it was trained on, and `own_features` is its name if it
        is a user's own; the logit is added to silence, but in a robot's own turn.
        """
        self._own_features = own_features
        self._network = network
        self._extractor = extractor
        self._silence_logit = silence_logit
        self._is_deterministic = is_deterministic
        self.uses = f"{extractor.uses}, by a trained graph neural network"

    @property
    def parameters(self) -> Parameters:
        """How it was made, and a digest that changes with its weights."""
        return {
            "receptive_field": self._network.shape.receptive_field,
            "is_deterministic": self._is_deterministic,
            "digest": self._digest(),
            **({"features": self._own_features} if self._own_features else {}),
        }

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Forgets packets; takes each mission's generator. Arguments as in `Policy.start`."""
        self._extractor.start(len(rngs), num_robots)
        self._uniform = Stream(rngs, uniform, (num_robots,))
        self._owner = torch.arange(num_robots).repeat(len(rngs))

    def recipients(self, views: LocalViews) -> Int[np.ndarray, "B N"]:
        """What each robot's own network draws from its own graph."""
        logits = self._logits(views)
        shape = views.silence.shape
        if self._is_deterministic:
            return logits.argmax(axis=1).reshape(shape)
        return sample(logits, self._uniform.next().ravel()).reshape(shape)

    def _logits(self, views: LocalViews) -> Float[np.ndarray, "R N"]:
        """Over the recipients of all robots, mission by mission."""
        graphs = self._extractor.graphs(views)
        parent = torch.from_numpy(graphs.parent.astype(np.int64))  # a copy: buffers are read-only
        node, may_address, has_turn = map(
            torch.from_numpy, (graphs.node, graphs.may_address, graphs.has_turn)
        )
        device, silence_logit = next(self._network.parameters()).device, self._silence_logit
        with torch.inference_mode(), _one_thread():
            output = self._network(*(each.to(device) for each in (node, parent, may_address))).cpu()
            return recipient_logits(
                output, self._owner, may_address, silence_logit, has_turn
            ).numpy()

    def _digest(self) -> str:
        """Return a hash of all that its decisions follow from."""
        said = (self._network.shape, self._extractor.names, self._silence_logit)
        digest = hashlib.sha256(repr(said).encode())
        for name, tensor in sorted(self._network.state_dict().items()):
            digest.update(name.encode() + b"\0" + tensor.cpu().contiguous().numpy().tobytes())
        return digest.hexdigest()[:DIGITS]


@contextmanager
def _one_thread() -> Iterator[None]:
    """Within it, torch starts no threads; the setting is the process's, so it is put back."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
