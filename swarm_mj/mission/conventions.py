"""Where the paper's text and its authors' code differ: each difference is a field."""

from dataclasses import dataclass
from typing import Literal, TypedDict, get_args

from swarm_mj.system.fields import setting

WallHit = Literal["mirror", "clip"]
HalfDuplex = Literal["strict", "eavesdroppers"]
FlockingSet = Literal["heard", "moving"]


@dataclass(frozen=True, kw_only=True)
class Conventions:
    """The text's conventions by default; `presets.reference` sets the code's.

    These have no help: they are no options, but a preset sets them all.
    """

    wall_hit: WallHit = setting(
        "mirror",
        label="wall hit",
        source="IV-A; the code clips",
        choices=get_args(WallHit),
    )
    half_duplex: HalfDuplex = setting(
        "strict",
        label="half duplex",
        source="II-A; by the code an addressed robot hears while it sends, only others do not",
        choices=get_args(HalfDuplex),
    )
    flocking_set: FlockingSet = setting(
        "heard",
        label="flocking set F",
        source="IV-A",
        choices=get_args(FlockingSet),
    )
    silence_is_attempt: bool = setting(
        False,
        source="II-B; the code also sets L of a silent robot to itself",
    )
    moves_each_transmission: bool = setting(
        False,
        source="IV-B; the code moves twice per window of flooding",
    )
    tree_recomputed: bool = setting(
        False,
        source="IV-C; the code rebuilds the tree of a mobile team each window",
    )
    tree_root_transmits: bool = setting(
        False,
        source="IV-C; the code's root addresses the last robot",
    )

    @property
    def recipient_hears_while_sending(self) -> bool:
        """True if a robot decodes what is addressed to it while it sends, though nothing else."""
        return self.half_duplex == "eavesdroppers"


class ConventionsFields(TypedDict, total=False):
    """Keywords for the fields of `Conventions`, as `mission.keywords` explains."""

    wall_hit: WallHit
    half_duplex: HalfDuplex
    flocking_set: FlockingSet
    silence_is_attempt: bool
    moves_each_transmission: bool
    tree_recomputed: bool
    tree_root_transmits: bool
