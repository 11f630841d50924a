"""The network: a graph neural network of one hop, over the neighbours that a robot believes in.

Each neighbour passes through two layers, together with the robot itself. Their sum and their
maximum pass through three more, with the robot again. What comes out is added to the rule's choice.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from residual_gnn.features import Neighbour, Own, Seen

OF_MESSAGES = 0.2  # of their sum: robots have about five neighbours
MESSAGE, DECISION, LOGIT = ("message.0", "message.2"), ("decision.0", "decision.2"), "logit"

Array = Float[np.ndarray, "..."]


@dataclass(frozen=True, eq=False)
class Weights:
    """The weights of a network, and all else that its decisions follow from but its inputs."""

    arrays: Mapping[str, Array]  # `LAYER.weight` and `LAYER.bias`, single precision
    prior_logit: float  # what the rule's own choice adds to the logit, or takes from it
    corrects_turns: bool  # whether it decides before the rule's schedule is in force, too

    @property
    def width(self) -> int:
        """The width of the layers."""
        return len(self.arrays[f"{MESSAGE[0]}.bias"])

    def logits(self, seen: Seen) -> Float[np.ndarray, "R"]:
        """Return the logit of transmitting, for every robot that decides."""
        robots, owner = seen.robots, seen.owner
        if not len(robots):
            return np.zeros(0, dtype=np.float32)
        messages = np.concatenate([seen.neighbours, robots[owner]], axis=1)
        for layer in MESSAGE:
            messages = np.maximum(self._linear(layer, messages), 0.0)
        total = np.zeros((len(robots), messages.shape[1]), dtype=np.float32)
        most = total.copy()
        # Rows of neighbours stand robot by robot; a robot without any has an empty sum.
        first = np.flatnonzero(np.diff(owner, prepend=-1))
        if len(first):
            total[owner[first]] = np.add.reduceat(messages, first)
            most[owner[first]] = np.maximum.reduceat(messages, first)
        hidden = np.concatenate([np.float32(OF_MESSAGES) * total, most, robots], axis=1)
        for layer in DECISION:
            hidden = np.maximum(self._linear(layer, hidden), 0.0)
        return self._linear(LOGIT, hidden)[:, 0] + np.float32(self.prior_logit) * robots[:, 0]

    def _linear(self, layer: str, rows: Array) -> Array:
        return rows @ self.arrays[f"{layer}.weight"].T + self.arrays[f"{layer}.bias"]


def shapes(width: int) -> dict[str, tuple[int, ...]]:
    """Return the shapes of a network's arrays, by name."""
    own, other = len(Own), len(Neighbour)
    layers = {
        MESSAGE[0]: (own + other, width),
        MESSAGE[1]: (width, width),
        DECISION[0]: (2 * width + own, 2 * width),
        DECISION[1]: (2 * width, width),
        LOGIT: (width, 1),
    }
    shapes: dict[str, tuple[int, ...]] = {}
    for layer, (before, after) in layers.items():
        shapes |= {f"{layer}.weight": (after, before), f"{layer}.bias": (after,)}
    return shapes
