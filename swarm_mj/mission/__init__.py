"""The mission (IV-B): its numbers, the two presets, and what is drawn before it begins."""

from swarm_mj.mission.specification import (
    MISSION_DISTANCE_M,
    PRESETS,
    Boundary,
    FlockingSet,
    HalfDuplex,
    Mission,
    PhysicsMode,
    Task,
    WallHit,
    paper,
    reference,
)

__all__ = [
    "MISSION_DISTANCE_M",
    "PRESETS",
    "Boundary",
    "FlockingSet",
    "HalfDuplex",
    "Mission",
    "PhysicsMode",
    "Task",
    "WallHit",
    "paper",
    "reference",
]
