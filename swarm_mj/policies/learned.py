"""Policies whose robots evaluate a trained network (III-C): their common base, and perceptrons.

`gnn.policy` has the Aggregation GNN, which flies teams of any size, and needs torch to.
"""

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.policies.gnn.graphs import FeatureExtractor, Graphs
from swarm_mj.policies.policy import DecentralisedPolicy, Parameters
from swarm_mj.policies.policy_config import MlpShape, Tensors
from swarm_mj.protocol.window import LocalViews
from swarm_mj.system.compiled import compiled

IMPOSSIBLE = -1e9  # the logit of a recipient that may not be addressed; finite, so that 0 p stays 0
DIGITS = 12  # of a digest: enough to tell policies apart


class LearnedPolicy(DecentralisedPolicy, ABC):
    """Robots address a draw from the network's Boltzmann distribution, or its mode."""

    def __init__(
        self, extractor: FeatureExtractor, *, is_deterministic: bool = False, own_features: str = ""
    ) -> None:
        """Take what makes the features that the network was trained on, and their name if own."""
        self._extractor = extractor
        self._own_features = own_features
        self._is_deterministic = is_deterministic

    @property
    def parameters(self) -> Parameters:
        """How it decides, and a digest that changes with its weights."""
        made_of, weights = self.identity()
        digest = hashlib.sha256(repr(made_of).encode())
        for name, values in sorted(weights.items()):
            digest.update(name.encode() + b"\0" + values.tobytes())
        its: dict[str, bool | int | float | str] = {
            "is_deterministic": self._is_deterministic,
            "digest": digest.hexdigest()[:DIGITS],
        }
        if self._own_features:
            its["features"] = self._own_features
        return its

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Forget packets; take each mission's generator. Arguments as in `Policy.start`."""
        self._extractor.start(len(rngs), num_robots)
        self._uniform = Stream(rngs, uniform, (num_robots,))

    def recipients(self, views: LocalViews) -> Int[np.ndarray, "B N"]:
        """Return what each robot's own network draws from its own view."""
        logits = self.logits(self._extractor.graphs(views))
        if self._is_deterministic:
            recipient = logits.argmax(axis=1)
        else:
            recipient = sample(logits, self._uniform.next().ravel())
        return recipient.reshape(views.silence.shape)

    @abstractmethod
    def logits(self, graphs: Graphs) -> Float[np.ndarray, "R N"]:
        """Return each robot's logits over recipients, mission by mission."""

    @abstractmethod
    def identity(self) -> tuple[object, Mapping[str, np.ndarray]]:
        """Return all that decisions follow from: the settings, and the weights by name."""


@compiled()
def sample(
    logits: Float[np.ndarray, "R N"], uniform: Float[np.ndarray, "R"]
) -> Int[np.ndarray, "R"]:
    """Return a draw from each row's Boltzmann distribution, by one number in [0, 1) a row."""
    num_rows, num_nodes = logits.shape
    chosen = np.zeros(num_rows, dtype=np.int64)
    weight = np.empty(num_nodes)
    for r in range(num_rows):
        highest = logits[r].max()  # taken off before exp, which would overflow
        total = 0.0
        for k in range(num_nodes):
            weight[k] = np.exp(logits[r, k] - highest)
            total += weight[k]
        left = uniform[r] * total
        for k in range(num_nodes):
            if weight[k] > 0.0:
                chosen[r] = k  # the last possible one, should rounding leave a rest
                left -= weight[k]
                if left < 0.0:
                    break
    return chosen


class MlpPolicy(LearnedPolicy):
    """Perceptrons on the features of all teammates in one row; they fit one team size alone."""

    def __init__(
        self,
        shape: MlpShape,
        weights: Tensors,
        extractor: FeatureExtractor,
        *,
        is_deterministic: bool = False,
        own_features: str = "",
    ) -> None:
        """Take weights of that shape, and what makes the features that they were trained on."""
        super().__init__(extractor, is_deterministic=is_deterministic, own_features=own_features)
        self._shape = shape
        self._weights = weights
        self.uses = f"{extractor.uses}, by a trained network"

    def logits(self, graphs: Graphs) -> Float[np.ndarray, "R N"]:
        """Return each robot's logits over recipients.

        Each mission is one product of matrices: one product of all would round otherwise for other
        numbers of missions, so a mission would depend on those flown with it.
        """
        shape = self._shape
        num_robots = shape.num_robots
        may_address = graphs.may_address.reshape(-1, num_robots, num_robots)
        node = graphs.node.reshape(*may_address.shape[:2], -1)
        values = np.concatenate([may_address.astype(np.float32), node], axis=2)
        for n in range(len(shape.hidden) + 1):
            if n > 0:
                values = np.tanh(values) if shape.activation == "tanh" else np.maximum(values, 0.0)
            weight = self._weights[f"{n}.weight"]
            bias = self._weights[f"{n}.bias"]
            values = values @ weight.T + bias
        logits = values.astype(np.float64).reshape(-1, num_robots)
        return np.where(graphs.may_address, logits, IMPOSSIBLE) if shape.obeys_mask else logits

    def identity(self) -> tuple[object, Tensors]:
        """Return the shape and the weights."""
        return self._shape, self._weights
