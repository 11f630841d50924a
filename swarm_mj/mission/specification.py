"""The mission (IV-B): every number of the paper with its unit and source.

Where the paper's text and its authors' code differ, each difference is a field of `Mission`:
`presets.paper` follows the text, `presets.reference` the code.
"""

import math
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal, get_args

import msgspec

from swarm_mj.system.fields import FieldOf, check, check_names, setting

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
CHANNEL = "channel"  # a heading of the help
NOTHING = "nothing"  # is known beforehand, beyond free space
NEW = "not the paper's"  # the source of what the paper has not
HELP = msgspec.toml.decode(Path(__file__).with_name("options.toml").read_bytes())  # by labels


def _named(label: str, default: object, **about: Any) -> FieldOf:
    """Return a field with a name in words; with a help text, it is an option."""
    return setting(default, HELP.get(label, ""), label=label, **about)


def _number(
    default: float | int | None, label: str, unit: str, low: float, high: float, **more: str | bool
) -> FieldOf:
    """Return a number: name in words, unit, range. By default it is of IV-B."""
    about: dict[str, Any] = {"source": "IV-B", "unit": unit, "low": low, "high": high}
    return _named(label, default, **about | more)


# Numbers of the channel beyond free space are options under a heading of their own.
_radio = partial(_number, group=CHANNEL, source=NEW)
_new = partial(_number, source=NEW, may_lack=True)


def _choice(default: str, label: str, source: str, choices: object, **about: Any) -> FieldOf:
    """Return one of several names, given as a `Literal`."""
    return _named(label, default, source=source, choices=get_args(choices), **about)


def in_order(prior_knowledge: str) -> str:
    """Return grants as they are kept: each once, in one order, joined by commas."""
    grants = dict.fromkeys(name.strip() for name in prior_knowledge.split(","))
    order = [*get_args(Knowable), *grants]  # unknown names stay, for the message that refuses them
    return ",".join(sorted(grants, key=order.index))


@dataclass(frozen=True, kw_only=True)
class Mission:
    """A mission's numbers; the defaults are the paper's text (IV-B).

    A field with a help text (`options.toml`) is an option, too: `num_robots` is `--robots`.

    Raises ValueError for a field outside its range, and names the value and the range; TypeError
    for an unknown field, and names the one most like it.
    """

    preset: str = _choice("paper", "preset", "IV-B", Preset)
    task: Task = _choice("flocking", "task", "IV", Task)
    num_robots: int = _number(40, "number of robots", "robots", 2.0, 10_000.0)
    density_per_km2: float = _number(40.0, "density", "robots/km²", 0.1, 10_000.0)
    range_ratio: float = _number(0.25, "range ratio", "of 1 km", 0.01, 10.0)
    velocity_ratio: float = _number(0.15, "velocity ratio", "of 1 km in 50 s", 0.001, 5.0)
    max_acceleration_mps2: float = _number(20.0, "A_max", "m/s²", 0.01, 1000.0)
    window_s: float = _number(0.1, "window", "s", 0.01, 10.0)
    num_windows: int = _number(500, "number of windows", "windows", 1.0, 100_000.0)
    # The paper writes "1 dBm", but a threshold on a ratio is a ratio: 1 dB.
    sinr_threshold_db: float = _number(1.0, "SINR threshold", "dB", -30.0, 60.0, group=CHANNEL)
    noise_dbm: float = _number(-50.0, "noise power", "dBm", -200.0, 50.0, group=CHANNEL)
    sensing_dbm: float | None = _radio(  # files of development versions lack it
        None, "sensing threshold", "dBm", -200.0, 50.0, may_lack=True
    )
    frequency_hz: float = _number(2.4e9, "centre frequency", "Hz", 1e6, 1e12)
    position_noise_m: float = _new(0.0, "position noise", "m", 0.0, 1e4)
    position_noise_s: float = _new(10.0, "position noise time", "s", 0.0, 1e5)
    failure_fraction: float = _number(0.0, "failure fraction", "of the team", 0.0, 0.9, source=NEW)
    arena: str = _named("arena", OPEN, metavar="NAME")

    # The channel beyond the paper's free space (`radio.mission_radio`).
    path_loss: PathLossLaw = _choice("free-space", "path loss", "Eq. 1", PathLossLaw, group=CHANNEL)
    loss_exponent: float = _radio(3.0, "path loss exponent", "1", 1.0, 10.0)
    reference_m: float = _radio(20.0, "reference distance", "m", 0.1, 10_000.0)
    antenna_height_m: float = _radio(1.0, "antenna height", "m", 0.1, 100.0)
    shadowing_db: float = _radio(0.0, "shadowing", "dB", 0.0, 30.0)
    shadowing_distance_m: float = _radio(20.0, "shadowing distance", "m", 0.1, 10_000.0)
    fading: FadingLaw = _choice("none", "fading", NEW, FadingLaw, group=CHANNEL)
    rician_k: float = _radio(4.0, "Rician K", "1", 0.0, 10_000.0)
    erasure: float = _radio(0.0, "erasure probability", "1", 0.0, 0.99)
    burst_begin: float = _radio(0.0, "burst begin", "per slot", 0.0, 0.5)
    burst_end: float = _radio(0.05, "burst end", "per slot", 0.001, 0.5)
    high_power_fraction: float = _radio(0.0, "high-power fraction", "of the team", 0.0, 1.0)
    high_power_db: float = _radio(6.0, "extra power", "dB", 0.0, 60.0)
    clock_offset_s: float = _radio(0.0, "clock offset", "s", 0.0, 10.0, may_lack=True)
    clock_drift_ppm: float = _radio(0.0, "clock drift", "ppm", 0.0, 10_000.0, may_lack=True)
    prior_knowledge: str = _choice(
        NOTHING, "prior knowledge", NEW, Knowable, group=CHANNEL, is_joined=True, convert=in_order
    )
    map_offset_m: float = _radio(0.0, "map offset", "m", 0.0, 1e4, may_lack=True)
    bit_rate: float | None = _radio(None, "bit rate", "bit/s", 1.0, 1e12, metavar="RATE")

    physics: PhysicsMode = _choice("exact", "physics", "Eq. 15", PhysicsMode)
    collide: bool = _named("robots collide", False)
    boundary: Boundary = _choice("reflect", "boundary", "IV-A", Boundary)
    wall_hit: WallHit = _choice("mirror", "wall hit", "IV-A; the code clips", WallHit)
    half_duplex: HalfDuplex = _choice("strict", "half duplex", "Eq. 3", HalfDuplex)
    flocking_set: FlockingSet = _choice("heard", "flocking set F", "Eq. 16", FlockingSet)
    silence_is_attempt: bool = False  # Eq. 7; the code also sets L of a silent robot to itself
    moves_each_transmission: bool = False  # IV-B; the code moves twice per window of flooding
    tree_recomputed: bool = False  # IV-C; the code rebuilds the tree of a mobile team each window
    tree_root_transmits: bool = False  # IV-C; the code's root addresses the last robot

    def __new__(cls, **given: Any) -> "Mission":
        """Refuse unknown fields by a message that names the likely one."""
        check_names("Mission", given, cls.__dataclass_fields__)
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
