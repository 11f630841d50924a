"""Transmission probabilities (IV-C: "some probability p") tuned per regime, in `tuned.csv`.

The table has one row per policy and regime; `tools/tune.py` wrote it.
"""

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from swarm_mj.mission import WORLDS, Mission
from swarm_mj.system.fields import check, same_as, setting
from swarm_mj.system.reading import read_rows

TABLE = Path(__file__).with_name("tuned.csv")
MAX_BYTES = 10_000_000


@dataclass(frozen=True, kw_only=True)
class Tuned:
    """The best probability of a policy in one regime: a row of the table, its columns in order."""

    policy: str  # a name among `POLICIES`
    preset: str = same_as(Mission, "preset")
    task: str = same_as(Mission, "task")
    num_robots: int = same_as(Mission, "num_robots")
    range_ratio: float = same_as(Mission, "range_ratio")  # of 1 km
    velocity_ratio: float = same_as(Mission, "velocity_ratio")  # means nothing to a team at rest
    probability: float = setting(low=0.0, high=1.0)  # the least mean age of a grid's
    aoi_mean: float = setting(low=0.0, high=1e9)  # with it, over the episodes (Eq. 10) [windows]
    aoi_sem: float = setting(low=0.0, high=1e9)  # standard error of that mean [windows]
    episodes: int  # missions flown with every probability of the grid
    first_seed: int  # of these, the others follow one by one
    version: str  # of the code that tuned it
    commit: str

    def __post_init__(self) -> None:
        check(self)


def tuned_probability(policy_name: str, mission: Mission) -> float:
    """Return a policy's tuned probability in the regime that is nearest to a mission's.

    Nearest by the ratios of team size, range and velocity, among the regimes of the same preset and
    task; ValueError if there are none.
    """
    # Worlds have the paper's numbers but for arena and channel.
    preset = "paper" if mission.preset in WORLDS else mission.preset
    group = (policy_name, preset, mission.task)
    rows = [row for row in _table() if (row.policy, row.preset, row.task) == group]
    if not rows:
        raise ValueError(
            f"{policy_name} has no tuned probability for {mission.preset} {mission.task} missions; "
            "pass one, or run tools/tune.py"
        )

    def distance(row: Tuned) -> float:  # between regimes: in logarithms, squared
        ratios = [row.num_robots / mission.num_robots, row.range_ratio / mission.range_ratio]
        if mission.task != "stationary":
            ratios.append(row.velocity_ratio / mission.velocity_ratio)
        return sum(math.log(ratio) ** 2 for ratio in ratios)

    return min(rows, key=distance).probability


def read_table(path: Path) -> list[Tuned]:
    """Return the rows of a table; ValueError if it is no such table, or a value is none."""
    names, rows = read_rows(path, "table", MAX_BYTES)
    kinds = Tuned.__annotations__
    if names != list(kinds):
        raise ValueError(f"columns of {path} must be {', '.join(kinds)}")
    tuned = []
    for line, row in rows:
        try:
            tuned.append(Tuned(**{name: kind(row[name]) for name, kind in kinds.items()}))
        except ValueError as error:
            raise ValueError(f"table {path}, line {line}: {error}") from error
    return tuned


@cache
def _table() -> list[Tuned]:
    return read_table(TABLE)
