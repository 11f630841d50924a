"""A policy's missions in one regime, flown: the columns of results are made of these."""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float, Shaped

from swarm_mj.evaluation.batch import BatchCosts
from swarm_mj.evaluation.published import Point, published
from swarm_mj.evaluation.samples import Interval, Sample, quantile_of_counts, share_interval
from swarm_mj.evaluation.study import Study
from swarm_mj.mission import Mission
from swarm_mj.policies.policy import Policy
from swarm_mj.protocol.costs import CostName
from swarm_mj.protocol.mission_costs import MissionCost
from swarm_mj.protocol.timestamps import SLOT_WINDOWS

T = TypeVar("T")
HOW = "how a column is computed"  # its place among the metadata of a field


@dataclass(frozen=True, kw_only=True, eq=False)
class Measurements:
    """A policy's missions in a regime, and the baseline's, which are the same missions."""

    study: Study
    mission: Mission  # the regime
    policy: str
    costs: BatchCosts
    baseline: str  # the policy that it is compared to
    baseline_costs: BatchCosts  # the same object as `costs` if that is the policy itself
    version: str  # of the code that flew
    commit: str | None

    @cached_property
    def made(self) -> Policy:
        """The policy, as it flew."""
        return self.study.make_policy(self.policy, self.mission)

    @cached_property
    def config(self) -> str:
        """All that the missions depend on but for their seeds, as JSON."""
        return json.dumps(self.study.config(self.policy, self.mission))

    @property
    def probability(self) -> float | None:
        """The probability of a transmission, for the policies that have one."""
        found = self.study.parameters[self.mission, self.policy].get("probability")
        return found if isinstance(found, int | float) else None

    def component(self, kind: str) -> str | None:
        """Return the name of a part of the user's own, such as a controller; None without one."""
        return self.study.components.names.get(kind)

    @cached_property
    def _task_cost(self) -> CostName | None:
        return self.study.task_cost(self.mission)

    @property
    def task_cost_name(self) -> str | None:
        """The name of the task's cost, as its controller calls it; None if it has none."""
        return None if self._task_cost is None else self._task_cost.name

    @property
    def task_cost_unit(self) -> str | None:
        """The unit of the task's cost."""
        return None if self._task_cost is None else self._task_cost.unit

    # The costs, a number of each mission.

    @cached_property
    def aoi(self) -> Sample:
        """Ages of information, means over windows [windows] (II-C)."""
        return Sample(self.costs.aoi)

    @property
    def aoi_steady(self) -> Sample:
        """The same over the second half of the mission."""
        return Sample(self.costs.aoi_steady)

    @property
    def aoi_floor(self) -> Sample:
        """The age that instant sharing within connected parts leaves [windows]; nan is unknown."""
        return Sample(self.costs.aoi_floor)

    @cached_property
    def velocity_variance(self) -> Sample:
        """Velocity variances, means over windows [m²/s²] (IV-A)."""
        return Sample(self.costs.velocity_variance)

    @property
    def task_cost(self) -> Sample:
        """The task's costs, means over windows; nan if it has none."""
        return Sample(self.costs.task_cost)

    @property
    def task_cost_last(self) -> Sample:
        """The same after the last window."""
        return Sample(self.costs.task_cost_last)

    def age_quantile(self, share: float) -> float:
        """Return the age below which this share of all pairs' ages lies [windows]."""
        return SLOT_WINDOWS * quantile_of_counts(self.costs.ages, share)

    # How they differ from the baseline's, mission by mission.

    @cached_property
    def aoi_difference(self) -> Sample:
        """Differences of the age of information [windows]; none of the baseline itself."""
        return self._difference(self.costs.aoi, self.baseline_costs.aoi)

    @cached_property
    def velocity_variance_difference(self) -> Sample:
        """Differences of the velocity variance [m²/s²]; none of the baseline itself."""
        own = self.costs.velocity_variance
        return self._difference(own, self.baseline_costs.velocity_variance)

    @cached_property
    def task_cost_difference(self) -> Sample:
        """Differences of the task's cost; none of the baseline itself, or if there is no cost."""
        return self._difference(self.costs.task_cost, self.baseline_costs.task_cost)

    def _difference(self, own: Float[np.ndarray, "B"], baseline: Float[np.ndarray, "B"]) -> Sample:
        difference = own - baseline
        if self.costs is self.baseline_costs or np.isnan(difference).any():
            return Sample(np.empty(0))
        return Sample(difference)

    # Packets.

    @property
    def num_sent(self) -> float:
        """Requests or broadcasts of all missions."""
        return float(self.costs.packets_sent.sum())

    @property
    def num_windows(self) -> int:
        """Windows of all missions."""
        return self.costs.aoi.size * self.mission.num_windows

    @cached_property
    def packet_bytes(self) -> int:
        """The size of a packet [bytes]."""
        return self.made.packet(self.mission).num_bytes

    @property
    def bytes_per_second(self) -> float:
        """The bytes that the team sends, responses too."""
        sent_bytes = self.packet_bytes * float(self.costs.packets_transmitted.sum())
        return sent_bytes / (self.num_windows * self.mission.window_s)

    def per_packet(self, counts: Float[np.ndarray, "B"]) -> float:
        """Return the share of all packets sent; nan if none was, or they are of another kind."""
        if self.num_sent == 0.0 or np.isnan(counts).all():
            return math.nan
        return float(np.nansum(counts)) / self.num_sent

    @property
    def complete(self) -> Float[np.ndarray, "B"]:
        """The windows after which everyone had heard of everyone.

        A mission that never was complete counts as late as any, so that the median stays honest.
        """
        return np.nan_to_num(self.costs.complete_window, nan=np.inf)

    # How flocks agree; there is nothing of robots that do not flock.

    def _of_flocks(self, numbers: Shaped[np.ndarray, "B"]) -> Shaped[np.ndarray, "n"]:
        return numbers if self.mission.flocks else np.empty(0)

    @property
    def agreed_window_median(self) -> float:
        """The median window from which on flocks had agreed; one that did not is later than all."""
        windows = np.nan_to_num(self.costs.agreed_window, nan=np.inf)
        return Sample(self._of_flocks(windows)).median

    @property
    def agreed_share(self) -> float:
        """The share of missions whose flock had agreed at the end."""
        return Sample(self._of_flocks(np.isfinite(self.costs.agreed_window).astype(float))).mean

    @property
    def agreed_share_interval(self) -> Interval:
        """That share's interval of 95 %."""
        return share_interval(self._of_flocks(np.isfinite(self.costs.agreed_window)))

    @property
    def decay_rate(self) -> Sample:
        """The rates at which velocity variances fell [1/window]; not of those that never did."""
        rate = self._of_flocks(self.costs.decay_rate)
        return Sample(rate[np.isfinite(rate)])

    @property
    def strayed(self) -> Sample:
        """The robots of each mission that were out of everyone's range at its end."""
        return Sample(self._of_flocks(self.costs.strayed))

    @property
    def crashed(self) -> Sample:
        """The robots of each mission that crashed; empty where robots are points."""
        return Sample(self.costs.crashed if self.mission.has_bodies else np.empty(0))

    @property
    def energy_j(self) -> Sample:
        """The energy of a robot in each mission; nan where that is not known."""
        return Sample(self.costs.energy_j)

    @property
    def most_energy_j(self) -> Sample:
        """The energy of the robot that used most in each mission; nan where that is not known."""
        return Sample(self.costs.most_energy_j)

    # The paper's own.

    def published_mean(self, cost: MissionCost) -> float | None:
        """Return the mean that the paper reports, if it has such missions."""
        point = self._published.get(cost.column)
        return None if point is None else point.mean

    def published_sem(self, cost: MissionCost) -> float | None:
        """Return the standard error of that mean."""
        point = self._published.get(cost.column)
        return None if point is None else point.sem

    @cached_property
    def _published(self) -> dict[str, Point]:
        if self.study.components.names:
            return {}  # the paper has no missions with parts of a user's own
        return published(self.policy, self.mission)


def column(value: Callable[[Measurements], T]) -> T:
    """Return a field of `Result`: a column that every file has, and how it is computed."""
    made: Any = field(metadata={HOW: value})  # type checkers take it for what `value` returns
    return made


def later_column(value: Callable[[Measurements], T], *, older: T) -> T:
    """Return a column that was added later: older files are read with `older` in its place."""
    made: Any = field(default=older, metadata={HOW: value})
    return made
