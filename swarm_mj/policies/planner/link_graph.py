"""The graph of links that a scheduler believes in: how far apart robots are, and who lies behind.

Index order: row `i` sends or is passed through, column `j` or `k` is reached or told of.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.policies.planner.settings import WeightSettings
from swarm_mj.radio.links import Links, lone_probabilities
from swarm_mj.system.compiled import compiled

OUT_OF_REACH = np.inf  # instead of a number of hops


@dataclass(frozen=True, kw_only=True)
class LinkGraph:
    """What follows from links alone; it is symmetric where all transmit with the same power."""

    probability: Float[np.ndarray, "N N"]  # that j decodes i when nobody else transmits
    is_linked: Bool[np.ndarray, "N N"]  # whether that is often enough to count
    hops: Float[np.ndarray, "N N"]  # expected transmissions from i to j, or `OUT_OF_REACH`
    downstream: Float[np.ndarray, "N N"]  # whom k's news reach through i by a shortest way, i too
    relative_std: float  # of the distance of linked robots, in the mean [1]

    @property
    def has_no_isolated_node(self) -> bool:
        """Whether everyone has a link."""
        return bool(np.all(np.any(self.is_linked, axis=1)))

    @property
    def linked_share(self) -> float:
        """The share of all pairs that are linked, among robots that have links."""
        num_linked = int(np.sum(np.any(self.is_linked, axis=1)))
        return float(np.sum(self.probability)) / max(1, num_linked * (num_linked - 1))


def link_graph(links: Links, settings: WeightSettings) -> LinkGraph:
    """Return the graph of these links; a link of probability p is a way of 1 / p hops."""
    probability = lone_probabilities(links)
    is_linked = probability >= settings.min_probability
    hops = _hops(np.where(is_linked, probability, 0.0))
    total = max(np.sum(probability), settings.min_probability)
    return LinkGraph(
        probability=probability,
        is_linked=is_linked,
        hops=hops,
        downstream=_downstream(hops, settings.slack_hops),
        relative_std=float(np.sum(probability / links.distance_over_std) / total),
    )


@compiled()
def _hops(probability: Float[np.ndarray, "N N"]) -> Float[np.ndarray, "N N"]:
    """Shortest ways, by Floyd and Warshall."""
    num_robots = probability.shape[0]
    hops = np.full((num_robots, num_robots), OUT_OF_REACH)
    for i in range(num_robots):
        for j in range(num_robots):
            if probability[i, j] > 0.0:
                hops[i, j] = 1.0 / probability[i, j]
        hops[i, i] = 0.0
    for via in range(num_robots):
        for i in range(num_robots):
            if hops[i, via] < OUT_OF_REACH:
                for j in range(num_robots):
                    hops[i, j] = min(hops[i, j], hops[i, via] + hops[via, j])
    return hops


@compiled()
def _downstream(hops: Float[np.ndarray, "N N"], slack: float) -> Float[np.ndarray, "N N"]:
    """How many robots lie behind i for news of k, i itself among them; 0 out of reach."""
    num_robots = hops.shape[0]
    behind = np.zeros((num_robots, num_robots))
    for i in range(num_robots):
        for k in range(num_robots):
            if hops[k, i] < OUT_OF_REACH:
                for j in range(num_robots):
                    if hops[k, j] < OUT_OF_REACH:
                        detour = hops[k, i] + hops[i, j] - hops[k, j]
                        behind[i, k] += 1.0 if detour < slack else 0.0
    return behind
