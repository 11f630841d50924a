"""The costs by which missions are judged, and what each is called where it is shown or paid."""

from typing import NamedTuple


class MissionCost(NamedTuple):
    """A cost of a mission: less is better."""

    column: str  # of results files, and of each mission's numbers
    reward: str  # whose minus is a team's reward
    info: str  # a window's, in environments' infos


AOI = MissionCost(column="aoi", reward="aoi", info="age_windows")
"""The age of information [windows] (II-C)."""

VELOCITY_VARIANCE = MissionCost(
    column="velocity_variance",
    reward="velocity-variance",
    info="velocity_variance_m2ps2",
)
"""How far the robots are from flying as one [m²/s²] (IV-A)."""

TASK_COST = MissionCost(column="task_cost", reward="task-cost", info="task_cost")
"""What the controller calls the cost of its task, in its unit; only some have one."""

MISSION_COSTS = (AOI, VELOCITY_VARIANCE, TASK_COST)
