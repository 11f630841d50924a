"""Transmission probabilities (IV-C: "some probability p") tuned per regime, in `tuned.csv`.

The table has one row per policy and regime; `tools/tune.py` wrote it.
"""

import math
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import msgspec

from swarm_mj.mission import WORLDS, Mission
from swarm_mj.system.reading import read_rows

TABLE = Path(__file__).with_name("tuned.csv")
MAX_BYTES = 10_000_000


@dataclass(frozen=True, kw_only=True)
class Tuned:
    """The best probability of a policy in one regime: a row of the table, its columns in order."""

    policy: str  # a name among `POLICIES`
    preset: str
    task: str
    num_robots: int
    range_ratio: float  # of 1 km
    velocity_ratio: float  # means nothing to a team at rest
    probability: float  # the least mean age of a grid's
    aoi_mean: float  # with it, over the episodes [windows]
    aoi_sem: float  # standard error of that mean [windows]
    episodes: int  # missions flown with every probability of the grid
    first_seed: int  # of these, the others follow one by one
    version: str  # of the code that tuned it
    commit: str


def tuned_probability(policy_name: str, mission: Mission) -> float:
    """Return a policy's tuned probability in the regime that is nearest to a mission's.

    Args:
        policy_name: A name among `registry.HAVE_PROBABILITY`.
        mission: What is flown.

    Returns:
        The probability, from 0 to 1, of the regime nearest by the ratios of team size, range and
        velocity, among those of the same preset and task.

    Raises:
        ValueError: If there is no such regime.
    """
    # Worlds have the paper's numbers but for arena and channel.
    preset = "paper" if mission.preset in WORLDS else mission.preset
    rows = _rows_of(policy_name, preset, mission.task)
    if not rows:
        raise ValueError(
            f"{policy_name} has no tuned probability for {mission.preset} {mission.task} missions; "
            "give one (--probability P, or probability=P in Python), choose a policy that needs "
            "none, or tune it: tools/tune.py makes the rows of policies/tuned.csv"
        )

    def distance(row: Tuned) -> float:
        """Return how far a regime is from the mission's: in logarithms, squared."""
        # In logarithms, since twice the robots are as far away as half of them.
        ratios = [row.num_robots / mission.num_robots, row.range_ratio / mission.range_ratio]
        if mission.moves:
            ratios.append(row.velocity_ratio / mission.velocity_ratio)
        return sum(math.log(ratio) ** 2 for ratio in ratios)

    return min(rows, key=distance).probability


def _rows_of(policy: str, preset: str, task: str) -> list[Tuned]:
    """Return the regimes in which a policy was tuned."""
    wanted = (policy, preset, task)
    return [row for row in _table() if (row.policy, row.preset, row.task) == wanted]


def read_table(path: Path) -> list[Tuned]:
    """Return the rows of a table, as `tools/tune.py` writes it; ValueError if it is none."""
    rows = read_rows(path, "table", MAX_BYTES)
    return msgspec.convert([row for _, row in rows], list[Tuned], strict=False)


_table = cache(partial(read_table, TABLE))
