"""The mission (IV-B): its numbers, its presets, and what is drawn before it begins."""

from swarm_mj.mission.conventions import FlockingSet
from swarm_mj.mission.keywords import MissionFields, PresetAndFields, TaskAndFields
from swarm_mj.mission.presets import PAPERS, PRESETS, WORLDS, make_mission, paper, reference
from swarm_mj.mission.specification import Mission
from swarm_mj.mission.team import MISSION_DISTANCE_M, Task

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
