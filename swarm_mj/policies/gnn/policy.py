"""A GNN as a policy: every robot's own network on its own buffer's graph (III-A to III-C).

Without torch, which takes seconds to import, until it flies.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from swarm_mj.policies.gnn.graphs import FeatureExtractor, Graphs
from swarm_mj.policies.learned import LearnedPolicy
from swarm_mj.policies.policy import Parameters
from swarm_mj.policies.policy_config import NO_BOUND, GnnShape, Tensors

if TYPE_CHECKING:
    from swarm_mj.policies.gnn.network import Network


MEMORY = "memory"  # the parameter that says how many numbers a robot remembers


@dataclass(frozen=True, kw_only=True)
class StoredGnn:
    """A network as its file holds it: what one of torch's can be made of."""

    shape: GnnShape
    weights: Tensors
    own: str = ""  # the name of its class, as `module:Name`, if it is a user's own


class GnnPolicy(LearnedPolicy):
    """Every robot runs the same graph neural network.

    As they are alike, one batch evaluates all of them.
    """

    def __init__(
        self,
        network: "Network | StoredGnn",
        extractor: FeatureExtractor,
        silence_logit: float = 0.0,
        *,
        most_speech: float = NO_BOUND,
        is_deterministic: bool = False,
        own_features: str = "",
    ) -> None:
        """Take a network and what makes the features that it was trained on.

        Args:
            network: Torch's own as it is, live, on any device: later changes of its weights count.
                One that was stored becomes torch's when it flies first.
            extractor: It makes the features, of the mission that is flown.
            silence_logit: Added to silence, except in a robot's own turn.
            most_speech: The probability with which a robot speaks in a window at most, except in
                its own turn; 1 is no bound.
            is_deterministic: Whether robots take the most probable recipient instead of a draw.
            own_features: The name of the features, as `module:Name`, if they are a user's own.
        """
        super().__init__(extractor, is_deterministic=is_deterministic, own_features=own_features)
        self._network = network
        self._own = network.own if isinstance(network, StoredGnn) else ""
        self._silence_logit = silence_logit
        self._most_speech = most_speech
        self._memory: np.ndarray | None = None
        self.uses = f"{extractor.uses}, by a trained graph neural network"
        if isinstance(network, StoredGnn) and network.own:
            remembers = " and what it remembers" if self._live_network().memory_size else ""
            self.uses = f"{extractor.uses}{remembers}, by a trained network, {network.own}"

    @property
    def parameters(self) -> Parameters:
        """The receptive field as well; of a user's own network, its name and its memory."""
        if not self._own:
            return {"receptive_field": self._network.shape.receptive_field, **super().parameters}
        its: Parameters = {"network": self._own, **super().parameters}
        memory_size = self._live_network().memory_size
        return {**its, MEMORY: memory_size} if memory_size else its

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Make torch's network before the first window; arguments as in `Policy.start`."""
        super().start(num_robots, rngs)
        memory_size = self._live_network().memory_size
        if memory_size:
            self._memory = np.zeros((len(rngs) * num_robots, memory_size), np.float32)

    def logits(self, graphs: Graphs) -> Float[np.ndarray, "R N"]:
        """Return each robot's logits over recipients, from its own graph; it may remember it."""
        from swarm_mj.policies.gnn.decisions import network_logits

        network = self._live_network()
        logits, self._memory = network_logits(
            network,
            graphs,
            silence_logit=self._silence_logit,
            most_speech=self._most_speech,
            memory=self._memory,
        )
        return logits

    def identity(self) -> tuple[object, Tensors]:
        """Return what the network is made of and sees, and its weights now."""
        made_of = (self._network.shape, self._extractor.names, self._silence_logit)
        if self._most_speech != NO_BOUND:  # else the digest stays that of earlier versions
            made_of = (*made_of, self._most_speech)
        if self._own:
            made_of = (*made_of, self._own)
        if isinstance(self._network, StoredGnn):
            return made_of, self._network.weights
        state = self._network.state_dict().items()
        return made_of, {name: tensor.cpu().contiguous().numpy() for name, tensor in state}

    def _live_network(self) -> "Network":
        if isinstance(self._network, StoredGnn):
            from swarm_mj.policies.gnn.own_networks import network_of

            stored = self._network
            self._network = network_of(stored.shape, stored.weights, stored.own)
        return self._network
