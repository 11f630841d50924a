"""The mission (IV-B): every number of the paper with its unit and source, and the two presets.

Where the paper's text and its authors' code differ, each difference is a field of `Mission`:
`paper()` follows the text, `reference()` the code.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np

from swarm_mj.fields import FieldOf, check, check_names, setting

Task = Literal["stationary", "random-walk", "flocking", "formation", "coverage"]
PhysicsMode = Literal["exact", "contact"]
Boundary = Literal["reflect", "none"]
WallHit = Literal["mirror", "clip"]
HalfDuplex = Literal["strict", "eavesdroppers"]
FlockingSet = Literal["heard", "moving"]

# Ratios are fractions of this distance, whatever the team's size (IV-B).
MISSION_DISTANCE_M = 1000.0
MISSION_DURATION_S = 50.0  # 500 windows of 100 ms: the duration that velocity ratios mean (IV-B)
SQUARE_METRES_PER_KM2 = 1e6


def _quantity(
    default: float | int,
    label: str,
    unit: str,
    source: str,
    low: float,
    high: float,
    help: str = "",
) -> FieldOf:
    """A number of the mission: name in words, unit, source, range; with help, an option."""
    return setting(default, help, label=label, unit=unit, source=source, low=low, high=high)


def _choice(default: str, label: str, source: str, choices: object, help: str = "") -> FieldOf:
    """One of several names, given as a `Literal`."""
    return setting(default, help, label=label, source=source, choices=get_args(choices))


@dataclass(frozen=True, kw_only=True)
class Mission:
    """A mission's numbers; the defaults are the paper's text (IV-B).

    Raises:
        ValueError: A field is outside its range; the message names the value and the range.
        TypeError: There is no such field; the message names the one most like it.
    """

    preset: str = _choice(
        "paper",
        "preset",
        "text or code",
        Literal["paper", "reference"],
        "the paper's text, or what its authors' code does",
    )
    task: Task = _choice("flocking", "task", "IV", Task, "what the robots do")
    num_robots: int = _quantity(
        40, "number of robots", "robots", "IV-B", 2.0, 1000.0, "size of the team"
    )
    density_per_km2: float = _quantity(40.0, "density", "robots/km²", "IV-B", 0.1, 10_000.0)
    range_ratio: float = _quantity(
        0.25, "range ratio", "of 1 km", "IV-B", 0.01, 10.0, "range of a packet in silence"
    )
    velocity_ratio: float = _quantity(
        0.15,
        "velocity ratio",
        "of 1 km in 50 s",
        "IV-B",
        0.001,
        5.0,
        "largest velocity per axis (0.15: 3 m/s)",
    )
    max_acceleration_mps2: float = _quantity(20.0, "A_max", "m/s²", "IV-B", 0.01, 1000.0)
    window_s: float = _quantity(0.1, "window", "s", "IV-B", 0.01, 10.0)
    num_windows: int = _quantity(
        500, "number of windows", "windows", "IV-B", 1.0, 100_000.0, "length, in windows of 100 ms"
    )
    # The paper writes "1 dBm", but a threshold on a ratio is a ratio: 1 dB.
    sinr_threshold_db: float = _quantity(1.0, "SINR threshold", "dB", "IV-B", -30.0, 60.0)
    noise_dbm: float = _quantity(-50.0, "noise power", "dBm", "IV-B", -200.0, 50.0)
    frequency_hz: float = _quantity(2.4e9, "centre frequency", "Hz", "IV-B", 1e6, 1e12)
    # `robot_failures.num_failures` says how many robots that is.
    switched_off: float = _quantity(
        0.0,
        "fraction of the robots that is switched off",
        "of the team",
        "not the paper's",
        0.0,
        0.9,
        "robots switched off half-way, unannounced",
    )

    physics: PhysicsMode = _choice(
        "exact",
        "physics",
        "Eq. 15 or forces",
        PhysicsMode,
        "Eq. 15 to rounding error, or forces and bounces",
    )
    boundary: Boundary = _choice(
        "reflect", "boundary", "IV-A", Boundary, "what the edge of the area does to robots"
    )
    wall_hit: WallHit = _choice("mirror", "wall hit", "IV-A; the code clips", WallHit)
    half_duplex: HalfDuplex = _choice("strict", "half duplex", "Eq. 3", HalfDuplex)
    flocking_set: FlockingSet = _choice("heard", "flocking set F", "Eq. 16", FlockingSet)
    silence_is_attempt: bool = False  # Eq. 7; the code also sets L of a silent robot to itself
    moves_each_transmission: bool = False  # IV-B; the code moves twice per window of flooding
    tree_recomputed: bool = False  # IV-C; the code rebuilds the tree of a mobile team each window
    tree_root_transmits: bool = False  # IV-C; the code's root addresses the last robot

    def __new__(cls, **given: Any) -> "Mission":
        """Refuses unknown fields in our words; else as any class."""
        check_names("Mission", given, cls.__dataclass_fields__)
        return super().__new__(cls)

    def __post_init__(self) -> None:
        check(self)
        for name, value in vars(self).items():
            if isinstance(value, np.generic):  # which JSON does not know
                object.__setattr__(self, name, value.item())

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
    def max_velocity_mps(self) -> float:
        """V_max: bound of the velocity per axis [m/s] (IV-B)."""
        return self.velocity_ratio * MISSION_DISTANCE_M / MISSION_DURATION_S

    @property
    def has_walls(self) -> bool:
        """Whether robots are reflected at the boundary of the area."""
        return self.boundary == "reflect"


def paper(task: Task = "flocking", **overrides: Any) -> Mission:
    """The paper's text, taken literally.

    Args:
        task: What the robots do; a flock has no boundary unless `overrides` give it one.
        **overrides: Any field of `Mission`.

    Returns:
        The mission.

    Raises:
        ValueError: A value is outside its range.
        TypeError: An override is no field of `Mission`.
    """
    boundary: Boundary = "none" if task == "flocking" else "reflect"
    return replace(Mission(task=task, boundary=boundary), **overrides)


def reference(task: Task = "flocking", **overrides: Any) -> Mission:
    """What the authors' published code does; the setting of the published numbers.

    Args:
        task: What the robots do; a flock has no boundary unless `overrides` give it one.
        **overrides: Any field of `Mission`.

    Returns:
        The mission.

    Raises:
        ValueError: A value is outside its range.
        TypeError: An override is no field of `Mission`.
    """
    code: dict[str, Any] = {
        "preset": "reference",
        "max_acceleration_mps2": 10.0,
        "wall_hit": "clip",
        "half_duplex": "eavesdroppers",
        "flocking_set": "moving",
        "silence_is_attempt": True,
        "moves_each_transmission": True,
        "tree_recomputed": task != "stationary",
        "tree_root_transmits": True,
    }
    return replace(paper(task), **(code | overrides))


PRESETS: dict[str, Callable[..., Mission]] = {"paper": paper, "reference": reference}
