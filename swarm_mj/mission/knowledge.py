"""Knowledge that robots have before the mission, and how much they can tell in a slot."""

from dataclasses import dataclass
from typing import Literal, TypedDict, get_args

from swarm_mj.mission.labels import CHANNEL, NEW
from swarm_mj.system.fields import set_to, setting

Grant = Literal["map", "statistics", "start"]  # what robots may know before the mission
Knowable = Literal["nothing", Grant]

NOTHING: Knowable = "nothing"  # is known beforehand, beyond free space


def in_order(prior_knowledge: str) -> str:
    """Return grants as they are kept: each once, in one order, joined by commas."""
    grants = dict.fromkeys(name.strip() for name in prior_knowledge.split(","))
    order = [*get_args(Knowable), *grants]  # unknown names stay, for the message that refuses them
    return ",".join(sorted(grants, key=order.index))


@dataclass(frozen=True, kw_only=True)
class Knowledge:
    """Prior knowledge, and what fits into a slot."""

    prior_knowledge: str = setting(
        NOTHING,
        "what robots know before the mission, several joined by commas",
        label="prior knowledge",
        source=NEW,
        choices=get_args(Knowable),
        is_joined=True,
        convert=in_order,
        former=("known",),
        group=CHANNEL,
    )
    map_offset_m: float = setting(
        0.0,
        "error of the robots' map, to the east",
        label="map offset",
        unit="m",
        low=0.0,
        high=1e4,
        source=NEW,
        group=CHANNEL,
        counts_with=set_to(prior_knowledge, "map"),
    )

    # What fits into a slot.
    bit_rate: float | None = setting(
        None,
        "in bit/s, as 250k or 6M; what does not fit into a slot, half a window, is not sent",
        label="bit rate",
        unit="bit/s",
        low=1.0,
        high=1e12,
        source=NEW,
        metavar="RATE",
        group=CHANNEL,
    )

    def grants(self, what: Knowable) -> bool:
        """Return whether robots know this before the mission."""
        return what in self.prior_knowledge.split(",")


class KnowledgeFields(TypedDict, total=False):
    """Keywords for the fields of `Knowledge`, as `mission.keywords` explains."""

    prior_knowledge: str
    map_offset_m: float
    bit_rate: float | None
