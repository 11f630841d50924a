"""The fields of `Mission`, as keywords of functions that make one (PEP 692).

A type checker refuses a misspelt keyword by these, and an editor completes it. It reads no code, so
each part of a mission has its names and types once more, below its dataclass; a test holds them
equal to those of `Mission`.
"""

from swarm_mj.mission.bodies import BodiesFields
from swarm_mj.mission.conventions import ConventionsFields
from swarm_mj.mission.dynamics import DynamicsFields
from swarm_mj.mission.faults import FaultsFields
from swarm_mj.mission.impairments import ImpairmentsFields
from swarm_mj.mission.knowledge import KnowledgeFields
from swarm_mj.mission.surroundings import SurroundingsFields
from swarm_mj.mission.team import Preset, Task, TeamFields
from swarm_mj.mission.transceiver import TransceiverFields


class MissionFields(
    TeamFields,
    TransceiverFields,
    FaultsFields,
    SurroundingsFields,
    ImpairmentsFields,
    KnowledgeFields,
    BodiesFields,
    DynamicsFields,
    ConventionsFields,
    total=False,
):
    """Fields of `Mission`, which says what they mean, but for the preset and the task.

    These two stand apart, for many functions have a parameter of that name, and a keyword can be
    declared in one place only.
    """


class PresetAndFields(MissionFields, total=False):
    """Keywords of functions that take the task by a parameter."""

    preset: Preset


class TaskAndFields(MissionFields, total=False):
    """Keywords of functions that take the preset by a parameter."""

    task: Task
