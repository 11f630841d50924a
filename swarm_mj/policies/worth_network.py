"""What news is worth to a scheduler, by a graph neural network.

One message pass over the believed links gives every robot a vector; a small network of a
receiver's vector, a subject's, and how they lie to each other gives the weights of `Worth`. The
mean vector gives the share that a half window must remain worth. Nothing keeps the weights
positive: what news is worth, and that it is worth anything, is learned.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Float32

from swarm_mj.policies.broadcasts import Worth
from swarm_mj.policies.greedy import HALVES, Links
from swarm_mj.policies.link_graph import LEAST_CHANCE, OUT_OF_REACH, link_graph

ROBOT_FEATURES = ("degree", "closeness", "eccentricity", "team_size", "doubt", "is_whole")
PAIR_FEATURES = ("downstream", "hops", "is_linked", "distance", "downstream_share")
WIDTH = 6  # of a robot's vector
PAIR_WIDTH = 8  # of a pair's
LEAST_SHARE, SHARE_SPAN = 0.4, 0.7
FAR_HOPS, FAR_DISTANCE = 20.0, 50.0  # in place of what is out of reach

Parameters = Mapping[str, Any]  # arrays or tensors of `SHAPES`
SHAPES: dict[str, tuple[int, ...]] = {
    "own": (len(ROBOT_FEATURES), WIDTH),
    "neighbours": (len(ROBOT_FEATURES), WIDTH),
    "robot_bias": (WIDTH,),
    "receiver": (WIDTH, PAIR_WIDTH),
    "subject": (WIDTH, PAIR_WIDTH),
    "pair": (len(PAIR_FEATURES), PAIR_WIDTH),
    "pair_bias": (PAIR_WIDTH,),
    "weights": (PAIR_WIDTH, 3),
    "weights_bias": (3,),
    "share": (WIDTH, 1),
    "share_bias": (1,),
}


@dataclass(frozen=True, kw_only=True)
class TeamFeatures:
    """What the network sees of a team, of order 1; arrays, or tensors where it is trained."""

    robot: Any  # [N, F]
    heard: Any  # [N, N]: chance of each link over the receiver's sum of chances
    pair: Any  # [N, N, G]; row: the receiver, column: the subject


class WorthNetwork:
    """The learned scorer; see `RuleOfThumb` for one made by hand."""

    def __init__(self, parameters: Mapping[str, Float[np.ndarray, "..."]], digest: str) -> None:
        """Takes the weights.

        Args:
            parameters: Arrays of `SHAPES`, by name.
            digest: A hash of them, kept beside what the policy costs.

        Raises:
            ValueError: An array is missing, unknown, or of another shape.
        """
        check_parameters(parameters)
        self._parameters = {name: np.asarray(a, dtype=np.float64) for name, a in parameters.items()}
        self._digest = digest

    @property
    def weights(self) -> Mapping[str, Float[np.ndarray, "..."]]:
        """The arrays of `SHAPES`, by name."""
        return self._parameters

    @property
    def parameters(self) -> Mapping[str, str]:
        """A digest that changes with its weights."""
        return {"digest": self._digest}

    def __call__(self, links: Links) -> Worth:
        """The network's weights; ages count in units of a quarter of N windows."""
        weights, share = forward(self._parameters, team_features(links), np.tanh)
        unit = HALVES * len(weights) / 4.0
        linear, squared, aged = np.moveaxis(weights, 2, 0)
        return Worth(
            np.ascontiguousarray(linear, dtype=np.float32),
            np.ascontiguousarray(squared / unit, dtype=np.float32),
            np.ascontiguousarray(aged / unit, dtype=np.float32),
            float(share),
        )


def check_parameters(parameters: Mapping[str, Float[np.ndarray, "..."]]) -> None:
    """Raises ValueError unless these are arrays of `SHAPES`, all of them finite."""
    for name in sorted(SHAPES.keys() ^ parameters.keys()):
        known = "lacks the" if name in SHAPES else "has an unknown"
        raise ValueError(f"it {known} tensor {name:.80}")
    for name, array in parameters.items():
        if array.shape != SHAPES[name]:
            raise ValueError(f"tensor {name} must be {SHAPES[name]}, not {array.shape}")
        if not np.all(np.isfinite(array)):
            raise ValueError(f"tensor {name} has numbers that are not finite")


def forward(
    parameters: Parameters, features: TeamFeatures, tanh: Callable[[Any], Any]
) -> tuple[Any, Any]:
    """The network, of arrays or of tensors.

    Args:
        parameters: Weights of `SHAPES`, by name.
        features: Of one team, arrays or tensors as the weights are.
        tanh: For these.

    Returns:
        Three weights for every receiver and subject [N, N, 3], and the share [1].
    """
    p = parameters
    own = features.robot @ p["own"]
    robot = tanh(own + features.heard @ (features.robot @ p["neighbours"]) + p["robot_bias"])
    of_pair = features.pair @ p["pair"] + p["pair_bias"]
    pair = tanh((robot @ p["receiver"])[:, None] + (robot @ p["subject"])[None] + of_pair)
    weights = pair @ p["weights"] + p["weights_bias"]
    logit = (robot.mean(0) @ p["share"] + p["share_bias"])[0]
    return weights, LEAST_SHARE + SHARE_SPAN * (1.0 + tanh(logit / 2.0)) / 2.0


def team_features(links: Links) -> TeamFeatures:
    """What the network sees of these links."""
    graph = link_graph(links)
    num_robots = len(graph.chance)
    degree = np.sum(graph.chance, axis=1)
    is_reached = graph.hops < OUT_OF_REACH
    reached = np.where(is_reached, graph.hops, 0.0)
    whole = np.full(num_robots, float(graph.is_whole))
    doubt = np.sum(graph.chance / links.sharpness, axis=1) / np.maximum(degree, LEAST_CHANCE)
    closeness = np.sum(reached, axis=1) / np.maximum(np.sum(is_reached, axis=1) - 1, 1)
    robot = [
        np.log1p(degree) / 2.0,
        np.minimum(closeness, FAR_HOPS) / 4.0,
        np.minimum(np.max(reached, axis=1), FAR_HOPS) / 8.0,
        np.full(num_robots, np.log(num_robots) / 4.0),
        10.0 * doubt,
        whole,
    ]
    downstream = np.maximum(graph.downstream, 1.0)
    pair = [
        np.log(downstream),
        np.log1p(np.minimum(graph.hops, FAR_HOPS)),
        (graph.chance >= LEAST_CHANCE).astype(float),
        np.log1p(np.minimum(graph.distance, FAR_DISTANCE)),
        downstream / num_robots,
    ]
    return TeamFeatures(
        robot=np.stack(robot, axis=1),
        heard=graph.chance / np.maximum(degree, LEAST_CHANCE)[:, None],
        pair=np.stack(pair, axis=2),
    )


def unpacked(flat: Float[np.ndarray, "S"]) -> dict[str, Float32[np.ndarray, "..."]]:
    """Arrays of `SHAPES` from one vector."""
    arrays, begin = {}, 0
    for name, shape in SHAPES.items():
        end = begin + int(np.prod(shape))
        arrays[name] = flat[begin:end].reshape(shape).astype(np.float32)
        begin = end
    return arrays


def num_weights() -> int:
    """How many numbers the network has."""
    return sum(int(np.prod(shape)) for shape in SHAPES.values())
