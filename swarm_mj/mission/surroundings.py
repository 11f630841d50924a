"""The surroundings: what stands between robots, and the power that it leaves (II-A)."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypedDict, get_args

from swarm_mj.mission.labels import CHANNEL, NEW
from swarm_mj.system.fields import above_zero, set_to, setting

PathLossLaw = Literal["free-space", "log-distance", "two-ray"]
FadingLaw = Literal["none", "rayleigh", "rician"]

OPEN = "open"  # the arena of the paper's missions: nothing stands in it


def _file_of_arena(arena: str) -> list[Path]:
    """Return the MJCF file that an arena's name is; the names of those in the package are none."""
    path = Path(arena)
    return [path] if path.is_file() else []


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """The arena, path loss, shadowing and fading."""

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
        "of points, above the floor, for two-ray",
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
        low=0.0,
        high=10_000.0,
        source=NEW,
        group=CHANNEL,
        counts_with=set_to(fading, "rician"),
    )


class SurroundingsFields(TypedDict, total=False):
    """Keywords for the fields of `Surroundings`, as `mission.keywords` explains."""

    arena: str
    path_loss: PathLossLaw
    loss_exponent: float
    reference_m: float
    antenna_height_m: float
    shadowing_db: float
    shadowing_distance_m: float
    fading: FadingLaw
    rician_k: float
