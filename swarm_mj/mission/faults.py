"""Faults of robots: errors of their own positions, and failures half-way."""

from dataclasses import dataclass
from typing import TypedDict

from swarm_mj.mission.labels import NEW
from swarm_mj.mission.team import Team
from swarm_mj.system.fields import above_zero, setting

MIN_SURVIVORS = 2  # whatever the fraction that fails, so that there is an age of information


@dataclass(frozen=True, kw_only=True)
class Faults(Team):
    """How far robots are off, and how many of a team fail."""

    position_noise_m: float = setting(
        0.0,
        "standard deviation of robots' own positions, per axis",
        label="position noise",
        unit="m",
        low=0.0,
        high=1e4,
        source=NEW,
    )
    position_noise_s: float = setting(
        10.0,
        "correlation time of position noise",
        label="position noise time",
        unit="s",
        low=0.0,
        high=1e5,
        source=NEW,
        counts_with=above_zero(position_noise_m),
    )
    failure_fraction: float = setting(
        0.0,
        "robots that fail half-way",
        label="failure fraction",
        unit="of the team",
        low=0.0,
        high=0.9,
        source=NEW,
        former=("switched_off",),
    )

    @property
    def num_failures(self) -> int:
        """Number of robots that fail: to the nearest, at least 1, but at least 2 survive."""
        if self.failure_fraction == 0.0:
            return 0
        nearest = max(1, round(self.failure_fraction * self.num_robots))
        return min(nearest, self.num_robots - MIN_SURVIVORS)

    @property
    def failure_window(self) -> int:
        """The window at whose start they fail, counted from 0 [windows]."""
        return self.num_windows // 2


class FaultsFields(TypedDict, total=False):
    """Keywords for the fields of `Faults`, as `mission.keywords` explains."""

    position_noise_m: float
    position_noise_s: float
    failure_fraction: float
