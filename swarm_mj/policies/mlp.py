"""A plain network as a policy: perceptrons on the features of all teammates, in one row.

Its weights fit one team size, so it flies no other; a GNN flies any.
"""

import itertools
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float

from swarm_mj.policies.gnn.feature_sets import check_num_features, is_own_set
from swarm_mj.policies.gnn.graphs import FeatureExtractor, Graphs
from swarm_mj.policies.learned import IMPOSSIBLE, LearnedPolicy
from swarm_mj.system.fields import check, setting

Activation = Literal["tanh", "relu"]
Weights = dict[str, np.ndarray]  # by name; `0.weight` [Out, In] and `0.bias` [Out] come first


@dataclass(frozen=True, kw_only=True)
class MlpShape:
    """The layers of a plain network; raises ValueError for what is unknown or out of range."""

    num_robots: int = setting(low=2, high=1000)  # N: of the one team size that it flies
    features: str  # the name of a feature set, see `FEATURE_SETS`
    num_features: int = setting(low=1, high=1024)  # F: numbers per teammate
    hidden: tuple[int, ...] = setting(low=1, high=4096)  # widths of the layers but the last
    activation: Activation = setting(choices=get_args(Activation))  # after all layers but the last
    obeys_mask: bool  # whether it addresses only recipients that the features allow

    def __post_init__(self) -> None:
        check(self)
        check_num_features(self.num_features, self.features)

    def tensors(self) -> dict[str, tuple[int, ...]]:
        """Return the weights' names and shapes."""
        inputs = self.num_robots * (1 + self.num_features)
        widths = [inputs, *self.hidden, self.num_robots]
        shapes: dict[str, tuple[int, ...]] = {}
        for n, (before, after) in enumerate(itertools.pairwise(widths)):
            shapes |= {f"{n}.weight": (after, before), f"{n}.bias": (after,)}
        return shapes


class MlpPolicy(LearnedPolicy):
    """A plain network that every robot evaluates on its own view."""

    def __init__(
        self,
        shape: MlpShape,
        weights: Weights,
        extractor: FeatureExtractor,
        *,
        is_deterministic: bool = False,
    ) -> None:
        """Take weights of that shape, and what makes the features that they were trained on."""
        own_features = shape.features if is_own_set(shape.features) else None
        super().__init__(extractor, is_deterministic=is_deterministic, own_features=own_features)
        self._shape = shape
        self._weights = weights
        self.uses = f"{extractor.uses}, by a trained network"

    def logits(self, graphs: Graphs) -> Float[np.ndarray, "R N"]:
        """Return each robot's logits over recipients.

        Each mission is one product of matrices: one product of all would round otherwise for other
        numbers of missions, so a mission would depend on those flown with it.
        """
        num_robots = self._shape.num_robots
        may_address = graphs.may_address.reshape(-1, num_robots, num_robots)
        node = graphs.node.reshape(*may_address.shape[:2], -1)
        values = np.concatenate([may_address.astype(np.float32), node], axis=2)
        num_layers = len(self._shape.hidden) + 1
        for n in range(num_layers):
            values = values @ self._weights[f"{n}.weight"].T + self._weights[f"{n}.bias"]
            if n < num_layers - 1:
                is_tanh = self._shape.activation == "tanh"
                values = np.tanh(values) if is_tanh else np.maximum(values, 0.0)
        logits = values.astype(np.float64).reshape(-1, num_robots)
        return (
            np.where(graphs.may_address, logits, IMPOSSIBLE) if self._shape.obeys_mask else logits
        )

    def identity(self) -> tuple[object, Weights]:
        """Return the shape and the weights."""
        return self._shape, self._weights
