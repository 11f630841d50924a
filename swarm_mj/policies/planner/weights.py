"""Weights of news, by a heuristic made by hand, from the graph of links that a scheduler believes.

Index order: row `i` sends or is passed through, column `j` or `k` is reached or is the subject.
"""

import numpy as np
from jaxtyping import Float

from swarm_mj.policies.planner.broadcast_scheduler import Weights
from swarm_mj.policies.planner.settings import WeightSettings
from swarm_mj.radio.links import Links, lone_probabilities
from swarm_mj.system.compiled import compiled

OUT_OF_REACH = np.inf  # instead of a number of hops


def heuristic_weights(links: Links, settings: WeightSettings) -> Weights:
    """Return the weights of squared rises of T: more at receivers that many robots lie behind.

    Squares prefer the stalest entries to many small refreshments. A receiver that passes news on to
    many others should get it early. The denser the links, the smaller the share of a slot's value
    that must remain when another robot transmits, and so the more robots transmit at once. Where
    links or positions are doubtful or a robot has no link, plans should not rely on every packet.
    """
    probability = lone_probabilities(links)
    is_linked = probability >= settings.min_probability
    has_link = np.any(is_linked, axis=1)
    hops = expected_hops(np.where(is_linked, probability, 0.0))
    behind = np.maximum(num_downstream(hops, settings.slack_hops), 1.0)
    weight = behind**settings.downstream_exponent
    weight *= np.clip(hops, 1.0, len(weight)) ** settings.hops_exponent
    share = settings.share_unlinked
    total, num_linked = float(np.sum(probability)), int(np.sum(has_link))
    if not links.is_doubtful:
        share += settings.share_per_link * total / max(1, num_linked * (num_linked - 1))
    doubt = np.sum(probability / links.distance_over_std) / max(total, settings.min_probability)
    share += settings.share_per_std * float(doubt)
    share += 0.0 if np.all(has_link) else settings.share_isolated
    return Weights(weight.astype(np.float32), min(share, settings.max_share))


@compiled()
def expected_hops(probability: Float[np.ndarray, "N N"]) -> Float[np.ndarray, "N N"]:
    """Return the expected transmissions from i to j by shortest ways (Floyd and Warshall)."""
    num_robots = probability.shape[0]
    hops = np.empty((num_robots, num_robots))
    for i in range(num_robots):
        for j in range(num_robots):
            # A link of probability p takes 1 / p transmissions.
            hops[i, j] = 1.0 / probability[i, j] if probability[i, j] > 0.0 else OUT_OF_REACH
        hops[i, i] = 0.0
    for via in range(num_robots):
        for i in range(num_robots):
            if hops[i, via] < OUT_OF_REACH:
                for j in range(num_robots):
                    hops[i, j] = min(hops[i, j], hops[i, via] + hops[via, j])
    return hops


@compiled()
def num_downstream(hops: Float[np.ndarray, "N N"], slack: float) -> Float[np.ndarray, "N N"]:
    """Return how many robots lie behind i for news of k, i itself among them; 0 out of reach."""
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
