"""What news is worth to a scheduler, by a rule made by hand."""

from typing import Protocol, runtime_checkable

import numpy as np

from swarm_mj.policies.planner.broadcast_scheduler import Weights
from swarm_mj.policies.planner.link_graph import link_graph
from swarm_mj.policies.policy import Parameters
from swarm_mj.radio.links import Links

# Chosen in trials on 8 stationary missions of 10 and 40 robots at range ratios from 0.2 to 1, and
# on 20 walking ones.
DOWNSTREAM_EXPONENT = 0.6
HOPS_EXPONENT = -0.3
SHARE_ALONE, SHARE_PER_LINK = 0.95, -0.3
SHARE_PER_DOUBT, SHARE_LACKING, MOST_SHARE = 3.0, 0.1, 1.05


@runtime_checkable
class Scorer(Protocol):
    """Says what news is worth between robots that are linked like this."""

    @property
    def parameters(self) -> Parameters:
        """What it was made with, by name."""
        ...

    def __call__(self, links: Links) -> Weights:
        """What a schedule is to weigh by."""
        ...


class RuleOfThumb:
    """Squared rises of T, more for receivers with many behind them, less for those far away.

    Squares prefer what is stalest to many small refreshments. A receiver that many others can hear
    of a subject through is worth telling early. The denser the links, the smaller the share that a
    half window must remain worth, and the more robots speak at once; but where positions are
    doubtful, or robots are missing, a schedule had better not rely on every packet.
    """

    @property
    def parameters(self) -> Parameters:
        """It has none."""
        return {}

    def __call__(self, links: Links) -> Weights:
        """The rule's weights."""
        graph = link_graph(links)
        weight = np.maximum(graph.downstream, 1.0) ** DOWNSTREAM_EXPONENT
        weight *= np.clip(graph.hops, 1.0, len(weight)) ** HOPS_EXPONENT
        share = SHARE_ALONE + SHARE_PER_LINK * graph.linked_share
        share += SHARE_PER_DOUBT * graph.relative_std
        share += 0.0 if graph.has_no_isolated_node else SHARE_LACKING
        return Weights(weight.astype(np.float32), min(share, MOST_SHARE))
