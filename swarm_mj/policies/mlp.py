"""A plain network as a policy: perceptrons on what a robot knows of its teammates, in one row.

What its weights belong to is a team's size, so it flies no other; a GNN flies any.
"""

import hashlib
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.policies.gnn.feature_sets import check_num_features, is_own_set
from swarm_mj.policies.gnn.graphs import FeatureExtractor
from swarm_mj.policies.gnn.sampling import IMPOSSIBLE, sample
from swarm_mj.policies.policy import DecentralisedPolicy, Parameters
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.system.fields import check, setting

Activation = Literal["tanh", "relu"]
Weights = dict[str, np.ndarray]  # by name; `0.weight` [Out, In] and `0.bias` [Out] come first
DIGITS = 12  # of a digest: enough to tell policies apart


@dataclass(frozen=True, kw_only=True)
class MlpShape:
    """What a plain network is made of.

    Raises:
        ValueError: A number is out of its range, or a name is unknown.
    """

    num_robots: int = setting(low=2, high=1000)  # N: of the one team size that it flies
    features: str  # the name of a feature set, see `FEATURE_SETS`
    num_features: int = setting(low=1, high=1024)  # F: numbers per teammate
    hidden: tuple[int, ...] = setting(low=1, high=4096)  # widths of the layers but the last
    activation: Activation = setting(choices=get_args(Activation))  # after all layers but the last
    obeys_mask: bool  # whether it addresses only those whom the features call worth a thought

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


class MlpPolicy(DecentralisedPolicy):
    """Addresses whom the network's Boltzmann distribution draws, or its mode."""

    def __init__(
        self,
        shape: MlpShape,
        weights: Weights,
        extractor: FeatureExtractor,
        *,
        is_deterministic: bool = False,
    ) -> None:
        """Take weights of that shape, and what makes the features that they were trained on."""
        self._shape = shape
        self._weights = weights
        self._extractor = extractor
        self.uses = f"{extractor.uses}, by a trained network"
        self._is_deterministic = is_deterministic

    @property
    def parameters(self) -> Parameters:
        """How it decides, and a digest that changes with its weights."""
        digest = hashlib.sha256(repr(self._shape).encode())
        for name, values in sorted(self._weights.items()):
            digest.update(name.encode() + b"\0" + values.tobytes())
        return {
            "is_deterministic": self._is_deterministic,
            "digest": digest.hexdigest()[:DIGITS],
            **({"features": self._shape.features} if is_own_set(self._shape.features) else {}),
        }

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Forgets packets; takes each mission's generator. Arguments as in `Policy.start`."""
        self._extractor.start(len(rngs), num_robots)
        self._uniform = Stream(rngs, uniform, (num_robots,))

    def recipients(self, views: LocalViews) -> Int[np.ndarray, "B N"]:
        """What each robot's own network draws from what it knows."""
        graphs = self._extractor.graphs(views)
        num_missions, num_robots = views.silence.shape
        shape = (num_missions, num_robots, num_robots)
        logits = self.logits(graphs.may_address.reshape(shape), graphs.node.reshape(*shape, -1))
        rows = logits.reshape(-1, num_robots)
        if self._is_deterministic:
            return rows.argmax(axis=1).reshape(views.silence.shape)
        return sample(rows, self._uniform.next().ravel()).reshape(views.silence.shape)

    def logits(
        self, may_address: Bool[np.ndarray, "B N N"], node: Float32[np.ndarray, "B N N F"]
    ) -> Float[np.ndarray, "B N N"]:
        """Over each robot's recipients; `IMPOSSIBLE` where its mask forbids one.

        Each mission is one product of matrices, so those beside it change nothing.
        """
        seen = node.reshape(*node.shape[:2], -1)
        values = np.concatenate([may_address.astype(np.float32), seen], axis=2)
        num_layers = len(self._shape.hidden) + 1
        for n in range(num_layers):
            values = values @ self._weights[f"{n}.weight"].T + self._weights[f"{n}.bias"]
            if n < num_layers - 1:
                is_tanh = self._shape.activation == "tanh"
                values = np.tanh(values) if is_tanh else np.maximum(values, 0.0)
        logits = values.astype(np.float64)
        return np.where(may_address, logits, IMPOSSIBLE) if self._shape.obeys_mask else logits
