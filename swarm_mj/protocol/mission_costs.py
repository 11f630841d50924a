"""The costs by which missions are judged: each declared once, whole.

What stores, pays, prints or draws a cost reads its names, its unit and its numbers here, so that
one cost has one name in each place.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from jaxtyping import Float

from swarm_mj.protocol.costs import WindowCosts

Reward: TypeAlias = Literal["aoi", "velocity-variance", "task-cost"]


@dataclass(frozen=True, kw_only=True)
class MissionCost:
    """A cost of a mission: less is better."""

    column: str  # of results files, and of each mission's numbers
    reward: Reward  # whose minus is a team's reward
    info: str  # a window's, in environments' infos
    title: str  # in words
    unit: str  # empty: each controller says its own
    digits: int  # after the point, where a table or a sentence has it
    # What a window costs in every mission, [B], in the unit; None if its task has no such cost.
    of_window: Callable[[WindowCosts], Float[np.ndarray, "B"] | None]

    @property
    def label(self) -> str:
        """The title and, in brackets, the unit, as axes have it."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


AOI = MissionCost(
    column="aoi",
    reward="aoi",
    info="age_windows",
    title="age of information",
    unit="windows",
    digits=2,
    of_window=lambda costs: costs.age_windows,
)
"""How old what the robots know of each other is, a mean over all pairs (II-C)."""

VELOCITY_VARIANCE = MissionCost(
    column="velocity_variance",
    reward="velocity-variance",
    info="velocity_variance_m2ps2",
    title="velocity variance",
    unit="m²/s²",
    digits=4,
    of_window=lambda costs: costs.velocity_variance_m2ps2,
)
"""How far the robots are from flying as one (IV-A)."""

TASK_COST = MissionCost(
    column="task_cost",
    reward="task-cost",
    info="task_cost",
    title="task cost",
    unit="",
    digits=2,
    of_window=lambda costs: None if costs.task_cost is None else costs.task_cost.value,
)
"""What the controller calls the cost of its task, in its unit; only some have one."""

MISSION_COSTS = (AOI, VELOCITY_VARIANCE, TASK_COST)
BY_REWARD: dict[str, MissionCost] = {cost.reward: cost for cost in MISSION_COSTS}
