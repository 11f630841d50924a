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
from swarm_mj.policies.policy_config import GnnShape, Weights

if TYPE_CHECKING:
    from swarm_mj.policies.gnn.network import AggregationGnn


@dataclass(frozen=True, kw_only=True)
class StoredGnn:
    """A network as its file holds it: what one of torch's can be made of."""

    shape: GnnShape
    weights: Weights


class GnnPolicy(LearnedPolicy):
    """Every robot runs the same graph neural network.

    As they are alike, one batch evaluates all of them.
    """

    def __init__(
        self,
        network: "AggregationGnn | StoredGnn",
        extractor: FeatureExtractor,
        silence_logit: float = 0.0,
        *,
        is_deterministic: bool = False,
        own_features: str = "",
    ) -> None:
        """Take a network and what makes the features that it was trained on.

        Args:
            network: Torch's own as it is, live, on any device: later changes of its weights count.
                One that was stored becomes torch's when it flies first.
            extractor: It makes the features, of the mission that is flown.
            silence_logit: Added to silence, except in a robot's own turn.
            is_deterministic: Whether robots take the most probable recipient instead of a draw.
            own_features: The name of the features, as `module:Name`, if they are a user's own.
        """
        super().__init__(extractor, is_deterministic=is_deterministic, own_features=own_features)
        self._network = network
        self._silence_logit = silence_logit
        self.uses = f"{extractor.uses}, by a trained graph neural network"

    @property
    def parameters(self) -> Parameters:
        """The receptive field as well."""
        return {"receptive_field": self._network.shape.receptive_field, **super().parameters}

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Make torch's network before the first window; arguments as in `Policy.start`."""
        super().start(num_robots, rngs)
        self._live_network()

    def logits(self, graphs: Graphs) -> Float[np.ndarray, "R N"]:
        """Return each robot's logits over recipients, from its own graph."""
        from swarm_mj.policies.gnn.decisions import network_logits

        return network_logits(self._live_network(), graphs, self._silence_logit)

    def identity(self) -> tuple[object, Weights]:
        """Return what the network is made of and sees, and its weights now."""
        made_of = (self._network.shape, self._extractor.names, self._silence_logit)
        if isinstance(self._network, StoredGnn):
            return made_of, self._network.weights
        state = self._network.state_dict().items()
        return made_of, {name: tensor.cpu().contiguous().numpy() for name, tensor in state}

    def _live_network(self) -> "AggregationGnn":
        if isinstance(self._network, StoredGnn):
            from swarm_mj.policies.gnn.fast import network_of

            self._network = network_of(self._network.shape, self._network.weights)
        return self._network
