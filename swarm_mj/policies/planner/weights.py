"""What news is worth to a schedule, by a heuristic made by hand."""

import numpy as np

from swarm_mj.policies.planner.broadcast_scheduler import Weights
from swarm_mj.policies.planner.link_graph import link_graph
from swarm_mj.policies.planner.settings import WeightSettings
from swarm_mj.radio.links import Links


def heuristic_weights(links: Links, settings: WeightSettings) -> Weights:
    """Squared rises of T: more at receivers that many are behind, less far from the source.

    Squares prefer the stalest entries to many small refreshments. A receiver that passes news on to
    many others is worth telling early. The denser the links, the smaller the share of a slot's
    worth that must remain when another robot transmits, and so the more robots transmit at once.
    Where links or positions are doubtful or a robot has no link, plans had better not rely on every
    packet.

    Args:
        links: The radio between the robots.
        settings: The exponents and shares.

    Returns:
        The weight of every receiver and subject, and the least share.
    """
    graph = link_graph(links, settings)
    weight = np.maximum(graph.downstream, 1.0) ** settings.downstream_exponent
    weight *= np.clip(graph.hops, 1.0, len(weight)) ** settings.hops_exponent
    share = settings.share_unlinked
    if not links.is_doubtful:
        share += settings.share_per_link * graph.linked_share
    share += settings.share_per_std * graph.relative_std
    share += 0.0 if graph.has_no_isolated_node else settings.share_isolated
    return Weights(weight.astype(np.float32), min(share, settings.max_share))
