"""The mission (IV-B): every number of the paper with its unit and source.

Where the paper's text and its authors' code differ, each difference is a field of `Mission`:
`presets.paper` follows the text, `presets.reference` the code.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypedDict, get_args

from swarm_mj.system.fields import (
    above_zero,
    check,
    check_names,
    former_names,
    set_to,
    setting,
)

Preset = Literal["paper", "reference", "indoor", "urban", "open-field"]
Task = Literal["stationary", "random-walk", "flocking"]
PhysicsMode = Literal["exact", "contact"]
Boundary = Literal["reflect", "none"]
WallHit = Literal["mirror", "clip"]
HalfDuplex = Literal["strict", "eavesdroppers"]
FlockingSet = Literal["heard", "moving"]
PathLossLaw = Literal["free-space", "log-distance", "two-ray"]
FadingLaw = Literal["none", "rayleigh", "rician"]
Grant = Literal["map", "statistics", "start"]  # what robots may know before the mission
Knowable = Literal["nothing", Grant]

# Ratios are fractions of this distance, whatever the team's size (IV-B).
MISSION_DISTANCE_M = 1000.0
MISSION_DURATION_S = 50.0  # 500 windows of 100 ms: the duration that velocity ratios mean (IV-B)
SQUARE_METRES_PER_KM2 = 1e6
MIN_SURVIVORS = 2  # whatever the fraction that fails, so that there is an age of information
OPEN = "open"  # the arena of the paper's missions: nothing stands in it
SENSED_ABOVE_NOISE_DB = 3.0  # of a preamble that its gain has lifted, or noise hides it
CHANNEL = "channel"  # a heading of the help
NOTHING = "nothing"  # is known beforehand, beyond free space
NEW = "not the paper's"  # the source of what the paper has not


def _file_of_arena(arena: str) -> list[Path]:
    """Return the MJCF file that an arena's name is; the names of those in the package are none."""
    path = Path(arena)
    return [path] if path.is_file() else []


def in_order(prior_knowledge: str) -> str:
    """Return grants as they are kept: each once, in one order, joined by commas."""
    grants = dict.fromkeys(name.strip() for name in prior_knowledge.split(","))
    order = [*get_args(Knowable), *grants]  # unknown names stay, for the message that refuses them
    return ",".join(sorted(grants, key=order.index))


@dataclass(frozen=True, kw_only=True)
class Mission:
    """A mission's numbers; the defaults are the paper's text (IV-B).

    Each field says its meaning, unit, range and source. One that has a help text is an option of
    the command line, too: `num_robots` is `--robots`. `paper` and the other presets make missions
    whose fields go together; `Mission(...)` itself takes every field as it is given.

    Raises:
        ValueError: A field is outside its range, or does not go with another; the message names
            the value and the range.
        TypeError: A field is unknown; the message names the one most like it.

    Example:
        >>> mission = Mission(task="stationary", num_robots=90, density_per_km2=10.0)
        >>> mission.side_m  # of the square area [m]
        3000.0
    """

    # What is flown.
    preset: str = setting(
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
        label="density",
        unit="robots/km²",
        low=0.1,
        high=10_000.0,
        source="IV-B",
    )
    range_ratio: float = setting(
        0.25,
        "range of a packet in silence",
        label="range ratio",
        unit="of 1 km",
        low=0.01,
        high=10.0,
        source="IV-B",
        is_common=True,
    )

    # How robots move (IV-A).
    velocity_ratio: float = setting(
        0.15,
        "per axis; 0.15 is 3 m/s",
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

    # The radio.
    sinr_threshold_db: float = setting(
        1.0,  # the paper writes "1 dBm", but a threshold on a ratio is a ratio
        "least SINR that decodes",
        label="SINR threshold",
        unit="dB",
        low=-30.0,
        high=60.0,
        source="IV-B",
        group=CHANNEL,
    )
    noise_dbm: float = setting(
        -50.0,
        "transmit power follows it",
        label="noise power",
        unit="dBm",
        low=-200.0,
        high=50.0,
        source="IV-B",
        group=CHANNEL,
    )
    sensing_dbm: float | None = setting(
        None,
        "power that csma and age-gain-csma sense",
        label="sensing threshold",
        unit="dBm",
        low=-200.0,
        high=50.0,
        source=NEW,
        group=CHANNEL,
    )
    sensing_gain_db: float = setting(
        10.0,  # an 11-chip Barker code, as of IEEE 802.11, has 10.4
        "how far a known preamble is lifted out of the noise where robots sense",
        label="sensing gain",
        unit="dB",
        low=0.0,
        high=40.0,
        source=NEW,
        group=CHANNEL,
    )
    sensing_miss: float = setting(
        0.0,
        "probability that a robot senses nothing in a slot",
        label="missed detection",
        unit="per slot",
        low=0.0,
        high=1.0,
        source=NEW,
        group=CHANNEL,
    )
    sensing_false_alarm: float = setting(
        0.0,
        "probability that it senses a busy channel in any case",
        label="false alarm",
        unit="per slot",
        low=0.0,
        high=1.0,
        source=NEW,
        group=CHANNEL,
    )
    minislots: int = setting(
        64,
        "moments of a slot in which robots that sense may begin",
        label="number of minislots",
        unit="per slot",
        low=1,
        high=1024,
        source=NEW,
        group=CHANNEL,
    )
    minislot_us: float = setting(
        20.0,
        "length of one; packets of policies that sense have the rest of the slot",
        label="minislot",
        unit="µs",
        low=0.0,
        high=500.0,
        source="IEEE 802.11, direct sequence",
        group=CHANNEL,
    )
    frequency_hz: float = setting(
        2.4e9,
        label="centre frequency",
        unit="Hz",
        low=1e6,
        high=1e12,
        source="IV-B",
    )

    # What robots get wrong, and how many fail.
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
        "its correlation time; it stays as it is while a robot stands",
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

    # What stands in the area. The arenas are those of `physics.arenas`, which this room is before.
    arena: str = setting(
        OPEN,
        "what stands in the area",
        label="arena",
        source=NEW,
        metavar="NAME",
        reads=_file_of_arena,
        is_common=True,
    )

    # Path loss.
    path_loss: PathLossLaw = setting(
        "free-space",
        "how power falls with distance",
        label="path loss",
        source="II-A",
        choices=get_args(PathLossLaw),
        group=CHANNEL,
    )
    loss_exponent: float = setting(
        3.0,
        "slope of log-distance: 2 is free space's",
        label="path loss exponent",
        unit="1",
        low=1.0,
        high=10.0,
        source=NEW,
        group=CHANNEL,
        counts_with=set_to(path_loss, "log-distance"),
    )
    reference_m: float = setting(
        20.0,
        "where log-distance begins",
        label="reference distance",
        unit="m",
        low=0.1,
        high=10_000.0,
        source=NEW,
        group=CHANNEL,
        counts_with=set_to(path_loss, "log-distance"),
    )
    antenna_height_m: float = setting(
        1.0,
        "above the floor, for two-ray",
        label="antenna height",
        unit="m",
        low=0.1,
        high=100.0,
        source=NEW,
        group=CHANNEL,
        counts_with=set_to(path_loss, "two-ray"),
    )

    # Shadowing and fading.
    shadowing_db: float = setting(
        0.0,
        "standard deviation of log-normal shadowing",
        label="shadowing",
        unit="dB",
        low=0.0,
        high=30.0,
        source=NEW,
        group=CHANNEL,
    )
    shadowing_distance_m: float = setting(
        20.0,
        "over which its correlation falls to 1/e",
        label="shadowing distance",
        unit="m",
        low=0.1,
        high=10_000.0,
        source=NEW,
        group=CHANNEL,
        counts_with=above_zero(shadowing_db),
    )
    fading: FadingLaw = setting(
        "none",
        "of every link, anew in each slot",
        label="fading",
        source=NEW,
        choices=get_args(FadingLaw),
        group=CHANNEL,
    )
    rician_k: float = setting(
        4.0,
        "power in line of sight over scattered; 0: Rayleigh",
        label="Rician K",
        unit="1",
        low=0.0,
        high=10_000.0,
        source=NEW,
        group=CHANNEL,
        counts_with=set_to(fading, "rician"),
    )

    # Packets lost at random, one by one or in bursts.
    erasure: float = setting(
        0.0,
        "share of packets lost at each receiver",
        label="erasure probability",
        unit="1",
        low=0.0,
        high=0.99,
        source=NEW,
        group=CHANNEL,
    )
    burst_begin: float = setting(
        0.0,
        "probability that a receiver goes deaf",
        label="burst begin",
        unit="per slot",
        low=0.0,
        high=0.5,
        source=NEW,
        group=CHANNEL,
    )
    burst_end: float = setting(
        0.05,
        "probability that it hears again",
        label="burst end",
        unit="per slot",
        low=0.001,
        high=0.5,
        source=NEW,
        group=CHANNEL,
        counts_with=above_zero(burst_begin),
    )

    # Robots with more transmit power.
    high_power_fraction: float = setting(
        0.0,
        "robots with more transmit power",
        label="high-power fraction",
        unit="of the team",
        low=0.0,
        high=1.0,
        source=NEW,
        former=("strong_share",),
        group=CHANNEL,
    )
    high_power_db: float = setting(
        6.0,
        "how much more that is",
        label="extra power",
        unit="dB",
        low=0.0,
        high=60.0,
        source=NEW,
        former=("strong_db",),
        group=CHANNEL,
        counts_with=above_zero(high_power_fraction),
    )

    # Clocks.
    clock_offset_s: float = setting(
        0.0,
        "largest difference between clocks",
        label="clock offset",
        unit="s",
        low=0.0,
        high=10.0,
        source=NEW,
        group=CHANNEL,
    )
    clock_drift_ppm: float = setting(
        0.0,
        "largest drift of a clock",
        label="clock drift",
        unit="ppm",
        low=0.0,
        high=10_000.0,
        source=NEW,
        group=CHANNEL,
    )

    # What robots know beforehand.
    prior_knowledge: str = setting(
        NOTHING,
        "what robots know before the mission, several joined by commas",
        label="prior knowledge",
        source=NEW,
        choices=get_args(Knowable),
        is_joined=True,
        convert=in_order,
        former=("known",),
        group=CHANNEL,
    )
    map_offset_m: float = setting(
        0.0,
        "how far east robots' map is of the truth",
        label="map offset",
        unit="m",
        low=0.0,
        high=1e4,
        source=NEW,
        group=CHANNEL,
        counts_with=set_to(prior_knowledge, "map"),
    )

    # What fits into a slot.
    bit_rate: float | None = setting(
        None,
        "in bit/s, as 250k or 6M; what does not fit into a slot, half a window, is not sent",
        label="bit rate",
        unit="bit/s",
        low=1.0,
        high=1e12,
        source=NEW,
        metavar="RATE",
        group=CHANNEL,
    )

    # Physics and walls.
    physics: PhysicsMode = setting(
        "exact",
        "the paper's, or forces, as obstacles need",
        label="physics",
        source="IV-A",
        choices=get_args(PhysicsMode),
    )
    collide: bool = setting(
        False,
        "robots bounce off each other, too, in contact physics",
        label="robots collide",
        source=NEW,
    )
    boundary: Boundary = setting(
        "reflect",
        "at the area's edge; reflect among obstacles",
        label="boundary",
        source="IV-A",
        choices=get_args(Boundary),
    )

    # Where the paper's text and its authors' code differ. These have no help: they are no options,
    # but a preset sets them all.
    wall_hit: WallHit = setting(
        "mirror",
        label="wall hit",
        source="IV-A; the code clips",
        choices=get_args(WallHit),
    )
    half_duplex: HalfDuplex = setting(
        "strict",
        label="half duplex",
        source="II-A",
        choices=get_args(HalfDuplex),
    )
    flocking_set: FlockingSet = setting(
        "heard",
        label="flocking set F",
        source="IV-A",
        choices=get_args(FlockingSet),
    )
    silence_is_attempt: bool = setting(
        False,
        source="II-B; the code also sets L of a silent robot to itself",
    )
    moves_each_transmission: bool = setting(
        False,
        source="IV-B; the code moves twice per window of flooding",
    )
    tree_recomputed: bool = setting(
        False,
        source="IV-C; the code rebuilds the tree of a mobile team each window",
    )
    tree_root_transmits: bool = setting(
        False,
        source="IV-C; the code's root addresses the last robot",
    )

    def __new__(cls, **given: Any) -> "Mission":
        """Refuse unknown fields by a message that names the likely one."""
        check_names("Mission", given, cls.__dataclass_fields__, former_names(cls))
        return super().__new__(cls)

    def __post_init__(self) -> None:
        check(self)
        if not isinstance(self.arena, str):
            raise ValueError(f"arena must be a name, not {self.arena!r:.80}")
        object.__setattr__(self, "prior_knowledge", in_order(self.prior_knowledge))
        if self.grants(NOTHING) and self.prior_knowledge != NOTHING:
            some = ", ".join(get_args(Grant))
            raise ValueError(
                f"prior knowledge must be nothing or some of {some}, not {self.prior_knowledge}"
            )
        if self.physics == "exact" and (self.arena != OPEN or self.collide):
            raise ValueError(
                "exact physics knows no collisions; choose physics contact, or arena open (it is "
                f"{self.arena}) whose robots pass through each other"
            )
        self._check_sensing()

    def _check_sensing(self) -> None:
        """Raise ValueError for what no receiver senses, or minislots that leave no slot."""
        floor_dbm = self.sensing_floor_dbm
        if self.sensing_dbm is not None and self.sensing_dbm < floor_dbm:
            raise ValueError(
                f"sensing threshold must be at least {floor_dbm:g} dBm, below which the noise of "
                f"{self.noise_dbm:g} dBm hides a preamble of {self.sensing_gain_db:g} dB gain, not "
                f"{self.sensing_dbm:g}; choose that or more, or a larger sensing gain"
            )
        if self.contention_s >= self.slot_s:
            raise ValueError(
                f"{self.minislots} minislots of {self.minislot_us:g} µs take "
                f"{1e3 * self.contention_s:g} ms, but a slot has {1e3 * self.slot_s:g} ms; choose "
                "fewer or shorter ones"
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
        """Length of a slot; a window has two (III-B) [s]."""
        return self.window_s / 2.0

    @property
    def sensing_floor_dbm(self) -> float:
        """Least power that robots can sense [dBm]."""
        return self.noise_dbm + SENSED_ABOVE_NOISE_DB - self.sensing_gain_db

    @property
    def contention_s(self) -> float:
        """Length of the minislots at the start of a slot, where robots sense [s]."""
        return self.minislots * self.minislot_us / 1e6

    @property
    def clocks_differ(self) -> bool:
        """True if robots' slots begin at different times (VI)."""
        return self.clock_offset_s > 0.0 or self.clock_drift_ppm > 0.0

    @property
    def max_velocity_mps(self) -> float:
        """V_max: bound of the velocity per axis [m/s] (IV-B)."""
        return self.velocity_ratio * MISSION_DISTANCE_M / MISSION_DURATION_S

    @property
    def has_walls(self) -> bool:
        """True if robots are reflected at the boundary of the area."""
        return self.boundary == "reflect"

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

    @property
    def num_high_power(self) -> int:
        """Number of robots with more transmit power: the first ones, to the nearest."""
        has_more = self.high_power_db > 0.0
        return round(self.high_power_fraction * self.num_robots) if has_more else 0

    def grants(self, what: str) -> bool:
        """Return whether robots know this before the mission."""
        return what in self.prior_knowledge.split(",")

    @property
    def moves(self) -> bool:
        """True if the robots move, in whatever way; a team at rest does not (IV-A)."""
        return self.task != "stationary"

    @property
    def flocks(self) -> bool:
        """True if the robots are to agree on one velocity (IV-A)."""
        return self.task == "flocking"


class MissionFields(TypedDict, total=False):
    """Fields of `Mission`, as keywords of functions that make one; `Mission` says what they mean.

    A type checker refuses a misspelt keyword by this, and an editor completes it. It reads no code,
    so names and types are written out once more; a test holds them equal to those of `Mission`.
    The preset and the task stand apart, for many functions have a parameter of that name, and a
    keyword can be declared in one place only (PEP 692).
    """

    num_robots: int
    density_per_km2: float
    range_ratio: float
    velocity_ratio: float
    max_acceleration_mps2: float
    window_s: float
    num_windows: int
    sinr_threshold_db: float
    noise_dbm: float
    sensing_dbm: float | None
    sensing_gain_db: float
    sensing_miss: float
    sensing_false_alarm: float
    minislots: int
    minislot_us: float
    frequency_hz: float
    position_noise_m: float
    position_noise_s: float
    failure_fraction: float
    arena: str
    path_loss: PathLossLaw
    loss_exponent: float
    reference_m: float
    antenna_height_m: float
    shadowing_db: float
    shadowing_distance_m: float
    fading: FadingLaw
    rician_k: float
    erasure: float
    burst_begin: float
    burst_end: float
    high_power_fraction: float
    high_power_db: float
    clock_offset_s: float
    clock_drift_ppm: float
    prior_knowledge: str
    map_offset_m: float
    bit_rate: float | None
    physics: PhysicsMode
    collide: bool
    boundary: Boundary
    wall_hit: WallHit
    half_duplex: HalfDuplex
    flocking_set: FlockingSet
    silence_is_attempt: bool
    moves_each_transmission: bool
    tree_recomputed: bool
    tree_root_transmits: bool


class PresetAndFields(MissionFields, total=False):
    """Keywords of functions that take the task by a parameter."""

    preset: str


class TaskAndFields(MissionFields, total=False):
    """Keywords of functions that take the preset by a parameter."""

    task: Task
