"""The team: its task, its size and area, how fast it moves, and for how long (IV-A, IV-B)."""

import math
from dataclasses import dataclass
from typing import Literal, TypedDict, get_args

from swarm_mj.system.fields import setting

Preset = Literal["paper", "reference", "indoor", "urban", "open-field"]
Task = Literal["stationary", "random-walk", "flocking"]

# Ratios are fractions of this distance, whatever the team's size (IV-B).
MISSION_DISTANCE_M = 1000.0
MISSION_DURATION_S = 50.0  # 500 windows of 100 ms: the duration that velocity ratios mean (IV-B)
SQUARE_METRES_PER_KM2 = 1e6
SLOTS_PER_WINDOW = 2  # a transmission takes one, and so do its responses (III-B)


@dataclass(frozen=True, kw_only=True)
class Team:
    """The task, the team and its area, how robots move, and time."""

    # What is flown.
    preset: Preset = setting(
        "paper",
        "the paper's text or code, or an arena with its channel",
        label="preset",
        source="IV-B",
        choices=get_args(Preset),
        is_common=True,
    )
    task: Task = setting(
        "flocking",
        "what the robots do",
        label="task",
        source="IV",
        choices=get_args(Task),
        is_common=True,
    )

    # The team and its area.
    num_robots: int = setting(
        40,
        "size of the team",
        label="number of robots",
        unit="robots",
        low=2,
        high=10_000,
        source="IV-B",
        is_common=True,
    )
    density_per_km2: float = setting(
        40.0,
        "robots in a square kilometre: it sets the size of the area",
        label="density",
        unit="robots/km²",
        low=0.1,
        high=10_000.0,
        source="IV-B",
    )
    range_ratio: float = setting(
        0.25,
        "range with no interference",
        label="range ratio",
        unit="km",
        low=0.01,
        high=10.0,
        source="IV-B",
        is_common=True,
    )

    # How robots move (IV-A).
    velocity_ratio: float = setting(
        0.15,
        "largest speed per axis; 0.15 is 3 m/s",
        label="velocity ratio",
        unit="of 1 km in 50 s",
        low=0.001,
        high=5.0,
        source="IV-B",
    )
    max_acceleration_mps2: float = setting(
        20.0,
        label="A_max",
        unit="m/s²",
        low=0.01,
        high=1000.0,
        source="IV-B",
    )

    # Time.
    window_s: float = setting(
        0.1,
        label="window",
        unit="s",
        low=0.01,
        high=10.0,
        source="IV-B",
    )
    num_windows: int = setting(
        500,
        "length, in windows, usually of 100 ms",
        label="number of windows",
        unit="windows",
        low=1,
        high=100_000,
        source="IV-B",
        is_common=True,
    )

    @property
    def side_m(self) -> float:
        """Side of the square area, at constant density [m] (IV-B)."""
        return math.sqrt(self.num_robots / self.density_per_km2 * SQUARE_METRES_PER_KM2)

    @property
    def half_side_m(self) -> float:
        """P_max: positions lie in (-P_max, P_max) per axis [m] (IV-A)."""
        return self.side_m / 2.0

    @property
    def range_m(self) -> float:
        """Distance at which a lone transmission just decodes [m] (IV-B)."""
        return self.range_ratio * MISSION_DISTANCE_M

    @property
    def slot_s(self) -> float:
        """Length of a slot; a window has `SLOTS_PER_WINDOW` [s]."""
        return self.window_s / SLOTS_PER_WINDOW

    @property
    def max_velocity_mps(self) -> float:
        """V_max: bound of the velocity per axis [m/s] (IV-B)."""
        return self.velocity_ratio * MISSION_DISTANCE_M / MISSION_DURATION_S

    @property
    def moves(self) -> bool:
        """True if the robots move, in whatever way; a team at rest does not (IV-A)."""
        return self.task != "stationary"

    @property
    def flocks(self) -> bool:
        """True if the robots are to agree on one velocity (IV-A)."""
        return self.task == "flocking"


class TeamFields(TypedDict, total=False):
    """Keywords for the fields of `Team`, as `mission.keywords` explains."""

    num_robots: int
    density_per_km2: float
    range_ratio: float
    velocity_ratio: float
    max_acceleration_mps2: float
    window_s: float
    num_windows: int
