"""The physics that move robots, and what stops them (IV-A)."""

from dataclasses import dataclass
from typing import Literal, TypedDict, get_args

from swarm_mj.mission.labels import NEW
from swarm_mj.system.fields import setting

PhysicsMode = Literal["exact", "contact"]
Boundary = Literal["reflect", "none"]


@dataclass(frozen=True, kw_only=True)
class Dynamics:
    """Physics, collisions and the edge of the area."""

    physics: PhysicsMode = setting(
        "exact",
        "exact: point masses by the paper's dynamics; contact: forces and collisions",
        label="physics",
        source="IV-A",
        choices=get_args(PhysicsMode),
    )
    collide: bool = setting(
        False,
        "robots touch each other, too: points bounce, quadrotors crash",
        label="robots collide",
        source=NEW,
    )
    boundary: Boundary = setting(
        "reflect",
        "what happens at the edge of the area",
        label="boundary",
        source="IV-A",
        choices=get_args(Boundary),
    )

    @property
    def has_walls(self) -> bool:
        """True if robots are reflected at the boundary of the area."""
        return self.boundary == "reflect"


class DynamicsFields(TypedDict, total=False):
    """Keywords for the fields of `Dynamics`, as `mission.keywords` explains."""

    physics: PhysicsMode
    collide: bool
    boundary: Boundary
