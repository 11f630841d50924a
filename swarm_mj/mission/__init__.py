"""The mission (IV-B): its numbers, its presets, and what is drawn before it begins."""

from swarm_mj.mission.presets import PAPERS, PRESETS, WORLDS, make_mission, paper, reference
from swarm_mj.mission.specification import (
    MISSION_DISTANCE_M,
    FlockingSet,
    Mission,
    MissionFields,
    PresetAndFields,
    Task,
    TaskAndFields,
)

__all__ = [
    "MISSION_DISTANCE_M",
    "PAPERS",
    "PRESETS",
    "WORLDS",
    "FlockingSet",
    "Mission",
    "MissionFields",
    "PresetAndFields",
    "Task",
    "TaskAndFields",
    "make_mission",
    "paper",
    "reference",
]
