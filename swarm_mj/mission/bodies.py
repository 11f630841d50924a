"""The robots' bodies: points as in the paper, or MuJoCo models with mass, height and heading."""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypedDict

from swarm_mj.mission.geometry import PLANE, SPACE
from swarm_mj.mission.labels import NEW
from swarm_mj.mission.team import Team
from swarm_mj.system.fields import above_zero, other_than, setting

LEAST_HEIGHT_M = 0.5  # of robots that fly: below it a set point does not sink
POINT = "point"  # the paper's robot: a mass without size, heading or height
ROVER = "rover"  # the robot of the package that stays on the floor
NEVER_FLY = (POINT, ROVER)


class RobotGroup(NamedTuple):
    """The robots of a team that are of one kind; their numbers follow each other."""

    kind: str  # the name of a robot of the package, or an MJCF file
    num_robots: int


def _files_of_robots(robot: str) -> list[Path]:
    """Return the MJCF files that the names of robots are; those in the package are none."""
    paths = [Path(kind) for kind, _ in _split(robot)]
    return [path for path in paths if path.is_file()]


def _split(robot: str) -> list[tuple[str, str]]:
    """Return each kind and the text of its number, which is empty for a kind that stands alone."""
    found = []
    for part in robot.split(","):
        kind, colon, number = part.rpartition(":")
        found.append((kind, number) if colon else (part, ""))
    return found


def _kinds(robot: str) -> list[str]:
    """Return the kinds that a team's robots are of."""
    return [kind for kind, _ in _split(robot)]


def can_fly(robot: str) -> bool:
    """Return whether some of a team's robots may fly: those of a file are taken to.

    Only its model, which is not read here, says whether such a robot flies.

    Args:
        robot: Their kind or kinds, as the field of `Mission`.
    """
    return any(kind not in NEVER_FLY for kind in _kinds(robot))


@dataclass(frozen=True, kw_only=True)
class Bodies(Team):
    """The robots' kind, how high they fly, and the air around them."""

    # The kinds are those of `physics.robots`, which this room is before.
    robot: str = setting(
        POINT,
        "point, quadrotor, rover or an MJCF file; or several, each with its number, joined by "
        "commas, as quadrotor:30,rover:10",
        label="robot",
        source=NEW,
        metavar="NAME",
        reads=_files_of_robots,
    )
    height_m: float = setting(
        20.0,
        "height at which robots fly, above the floor",
        label="height",
        unit="m",
        low=LEAST_HEIGHT_M,
        high=1000.0,
        source=NEW,
        counts_with=other_than(robot, *NEVER_FLY, parts=_kinds),
    )
    height_range_m: float = setting(
        0.0,
        "how much higher some fly: heights are spread evenly over this",
        label="range of heights",
        unit="m",
        low=0.0,
        high=1000.0,
        source=NEW,
        counts_with=other_than(robot, *NEVER_FLY, parts=_kinds),
    )
    robot_spread: float = setting(
        0.0,
        "standard deviation of robots' mass and of their motors' force",
        label="spread of robots",
        unit="of the model's",
        low=0.0,
        high=0.2,
        source=NEW,
        counts_with=other_than(robot, POINT),
    )
    wind_mps: float = setting(
        0.0,
        "mean wind, to the east",
        label="wind",
        unit="m/s",
        low=0.0,
        high=50.0,
        source=NEW,
        counts_with=other_than(robot, POINT),
    )
    gust_mps: float = setting(
        0.0,
        "standard deviation of the wind, per axis of the plane",
        label="gusts",
        unit="m/s",
        low=0.0,
        high=20.0,
        source=NEW,
        counts_with=other_than(robot, POINT),
    )
    gust_s: float = setting(
        3.0,
        "correlation time of gusts",
        label="time of gusts",
        unit="s",
        low=0.1,
        high=1000.0,
        source="Gauss-Markov",
        counts_with=above_zero(gust_mps),
    )

    @property
    def has_bodies(self) -> bool:
        """True if robots are MuJoCo models, not points."""
        return self.robot != POINT

    @property
    def has_wind(self) -> bool:
        """True if a wind pushes the robots, which must have bodies."""
        return self.has_bodies and (self.wind_mps > 0.0 or self.gust_mps > 0.0)

    @property
    def num_axes(self) -> int:
        """D: axes of positions and velocities, 2 of points and 3 of bodies."""
        return SPACE if self.has_bodies else PLANE

    @property
    def groups(self) -> list[RobotGroup]:
        """The kinds of robots, in the order of their numbers.

        Raises:
            ValueError: Their numbers are none, or do not add up to the team's.
        """
        parts = _split(self.robot)
        if len(parts) == 1 and not parts[0][1]:
            return [RobotGroup(self.robot, self.num_robots)]
        found = []
        for kind, number in parts:
            if not number.isdecimal() or int(number) < 1 or kind == POINT:
                raise ValueError(
                    f"robot must be a kind, or kinds with their numbers, as quadrotor:30,rover:10, "
                    f"and none of them a point; not {self.robot!r}"
                )
            found.append(RobotGroup(kind, int(number)))
        total = sum(group.num_robots for group in found)
        if total != self.num_robots:
            raise ValueError(
                f"robot {self.robot} are {total} robots, but the team has {self.num_robots}; "
                f"choose {total} robots (--robots {total}), or other numbers"
            )
        return found


class BodiesFields(TypedDict, total=False):
    """Keywords for the fields of `Bodies`, as `mission.keywords` explains."""

    robot: str
    height_m: float
    height_range_m: float
    robot_spread: float
    wind_mps: float
    gust_mps: float
    gust_s: float
