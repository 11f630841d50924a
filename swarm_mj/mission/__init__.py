"""The mission (IV-B): its numbers, its presets, and what is drawn before it begins."""

from swarm_mj.mission.presets import PAPERS, PRESETS, WORLDS, make_mission, paper, reference
from swarm_mj.mission.specification import (
    MISSION_DISTANCE_M,
    Boundary,
    FlockingSet,
    HalfDuplex,
    Mission,
    PhysicsMode,
    Task,
    WallHit,
)

__all__ = [
    "MISSION_DISTANCE_M",
    "PAPERS",
    "PRESETS",
    "WORLDS",
    "Boundary",
    "FlockingSet",
    "HalfDuplex",
    "Mission",
    "PhysicsMode",
    "Task",
    "WallHit",
    "make_mission",
    "paper",
    "reference",
]
