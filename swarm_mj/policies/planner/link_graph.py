"""The graph of links that a scheduler believes in: how far apart robots are, and who lies behind.

Index order: row `i` sends or is passed through, column `j` or `k` is reached or told of.
"""

from dataclasses import dataclass
from typing import no_type_check

import numpy as np
from jaxtyping import Float
from numba import njit

from swarm_mj.policies.planner.broadcast_scheduler import CERTAIN, LOGISTIC
from swarm_mj.radio.links import Links

LEAST_CHANCE = 0.05  # links that decode more rarely count as none
OUT_OF_REACH = np.inf  # instead of a number of hops
SLACK = 0.25  # hops by which a way may be longer than the shortest and still count as one


@dataclass(frozen=True, kw_only=True)
class LinkGraph:
    """What follows from links alone; it is symmetric, as the links are."""

    chance: Float[np.ndarray, "N N"]  # probability that j decodes i when nobody else speaks
    distance: Float[np.ndarray, "N N"]  # of i and j, in ranges [1]
    hops: Float[np.ndarray, "N N"]  # expected transmissions from i to j, or `OUT_OF_REACH`
    downstream: Float[np.ndarray, "N N"]  # whom k's news reach through i by a shortest way, i too
    relative_std: float  # of the distance of linked robots, in the mean [1]

    @property
    def has_no_isolated_node(self) -> bool:
        """Whether everyone has a link."""
        return bool(np.all(np.any(self.chance >= LEAST_CHANCE, axis=1)))

    @property
    def linked_share(self) -> float:
        """The share of all pairs that are linked, among robots that have links."""
        num_linked = int(np.sum(np.any(self.chance >= LEAST_CHANCE, axis=1)))
        return float(np.sum(self.chance)) / max(1, num_linked * (num_linked - 1))


def link_graph(links: Links) -> LinkGraph:
    """The graph of these links; a link of chance c is a way of 1 / c hops."""
    chance, distance = _lone_chances(links)
    hops = _hops(np.where(chance >= LEAST_CHANCE, chance, 0.0))
    return LinkGraph(
        chance=chance,
        distance=distance,
        hops=hops,
        downstream=_downstream(hops, SLACK),
        relative_std=float(
            np.sum(chance / links.distance_over_std) / max(np.sum(chance), LEAST_CHANCE)
        ),
    )


def _lone_chances(links: Links) -> tuple[Float[np.ndarray, "N N"], Float[np.ndarray, "N N"]]:
    """Chances without interference, and distances in ranges; nobody hears itself."""
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.sqrt(links.noise_mw * links.threshold / links.received_mw)
        deviations = (1.0 / distance - 1.0) * links.distance_over_std
    deviations = np.where(np.isnan(deviations), 0.0, deviations)  # a known distance of one range
    chance = 1.0 / (1.0 + np.exp(-LOGISTIC * np.clip(deviations, -CERTAIN, CERTAIN)))
    is_certain = np.isinf(links.distance_over_std) | (np.abs(deviations) > CERTAIN)
    chance = np.where(is_certain, (distance <= 1.0).astype(float), chance)
    chance[links.received_mw <= 0.0] = 0.0
    return chance, distance


@njit(cache=True)
@no_type_check
def _hops(chance: Float[np.ndarray, "N N"]) -> Float[np.ndarray, "N N"]:
    """Shortest ways, by Floyd and Warshall."""
    num_robots = chance.shape[0]
    hops = np.full((num_robots, num_robots), OUT_OF_REACH)
    for i in range(num_robots):
        for j in range(num_robots):
            if chance[i, j] > 0.0:
                hops[i, j] = 1.0 / chance[i, j]
        hops[i, i] = 0.0
    for via in range(num_robots):
        for i in range(num_robots):
            if hops[i, via] < OUT_OF_REACH:
                for j in range(num_robots):
                    hops[i, j] = min(hops[i, j], hops[i, via] + hops[via, j])
    return hops


@njit(cache=True)
@no_type_check
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
