"""Which policy of a run is kept, and when a run no longer learns: decided from its curve alone.

The best of many noisy evaluations is biased. So the best few are flown again, on missions that
none of them was judged on, and the reported age is from a third set. `held_out` flies them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta

from swarm_mj.learning.settings import Training

ORACLE = "greedy-oracle"
# Policies without a payload or training, and what each knows.
REFERENCES = {
    "tdma": "robots take turns that were agreed beforehand",
    "spatial-tdma": "robots that believe themselves far apart share a turn",
    ORACLE: "knows where all robots are and what they know",
}
COMPARED = ("tdma", "spatial-tdma")  # at the end, too: the oracle takes longer than the network
JUDGED = ("aoi", "velocity_variance")  # costs that a run can lower
ORACLE_MISSIONS = 4  # of each team size: a window takes it 12 ms at 40 robots, 36 ms at 80 ...
ORACLE_ROBOTS = 100  # ... and 472 ms at 200: larger teams it does not fly
NUM_BEST = 3  # evaluations whose policies are flown again
OTHER_FLIGHTS = 2 + len(COMPARED)  # at the end: the one that is kept, again, and the first
NEAR = 1.25  # times the least objective: worse policies have lost already
MAX_MISSIONS = 40  # of each team size, to choose
FLOWN_SHARE = 0.5  # of a run's decisions, for its choice; they cost less than learning
RESERVED_SHARE = 0.5  # of a run's minutes, at most, kept back for its choice
MIN_GAIN = 0.005  # of the objective, that counts as learning

# Ranges of a run's progress, where it is read back.
Count = Annotated[int, Meta(ge=0, le=2**62)]
Amount = Annotated[float, Meta(ge=0.0, le=1e30)]
Row = dict[str, float]


@dataclass(frozen=True, kw_only=True)
class Cost:
    """A policy's age of information [windows], or its velocity variance [m²/s²]."""

    mean: Amount
    sem: Amount | None  # None of one mission
    behind: float = 0.0  # how much more the policy that is kept costs on the same missions
    behind_sem: Amount | None = None


@dataclass(frozen=True, kw_only=True)
class Choice:
    """The policy that is kept, and its cost on missions that did not choose it."""

    decisions: Count  # of teams, that it learned from
    run_decisions: Count  # that the run had made when it was chosen
    num_finalists: Count
    num_missions: Count  # of each team size that chose it, and as many others that tell its cost
    kept: Cost
    others: dict[str, Cost]  # on the same missions: `COMPARED`, and `first`


def column(cost: str, name: str) -> str:
    """Return the learning curve's column for a cost of a policy of `REFERENCES`."""
    return f"{cost}_{name.replace('-', '_')}"


REFERENCE_COLUMNS = [column(cost, name) for cost in JUDGED for name in REFERENCES]


def reference_missions(training: Training) -> dict[str, int]:
    """Return how many held-out missions of each team size each of `REFERENCES` flies, if any."""
    flown = dict.fromkeys(REFERENCES, training.held_out)
    flown[ORACLE] = min(training.held_out, ORACLE_MISSIONS)
    if max(training.robots) > ORACLE_ROBOTS:
        del flown[ORACLE]
    return flown


def candidates(curve: Sequence[Row]) -> list[Row]:
    """Return evaluations whose policies may be chosen: the best few, and the first, the start."""
    best = sorted(curve, key=lambda row: row["objective"])[:NUM_BEST]
    return [row for row in curve if row in best or row is curve[0]]


def finalists(curve: Sequence[Row]) -> list[Row]:
    """Return candidates that may be the best in truth, though not on the held-out missions."""
    rows = candidates(curve)
    near = NEAR * min(row["objective"] for row in rows)
    return [row for row in rows if row["objective"] <= near]


def num_missions(training: Training, decisions: int, num_flights: int) -> int:
    """Return the missions of each team size that a flight has at the end.

    All flights together take up to a share of the run, but each has at least the missions of an
    evaluation: fewer would tell less than is known already.
    """
    windows = num_flights * len(training.robots) * training.mission.num_windows
    within = int(FLOWN_SHARE * decisions / windows)
    return max(training.held_out, min(MAX_MISSIONS, within))


def reserved_minutes(
    training: Training, decisions: int, evaluation_minutes: float, limit: float
) -> float:
    """Return the part of a run's minutes that its last evaluation and its choice will take."""
    num_flights = NUM_BEST + 1 + OTHER_FLIGHTS
    missions = num_flights * num_missions(training, decisions, num_flights)
    needed = evaluation_minutes * (1 + missions / training.held_out)
    return min(needed, RESERVED_SHARE * limit)


def has_stalled(curve: Sequence[Row], patience: int | None) -> bool:
    """Return whether the last `patience` evaluations brought no gain; never with None or 0."""
    if not patience or len(curve) <= patience:
        return False
    before, since = (
        min((row["objective"] for row in rows), default=math.inf)
        for rows in (curve[:-patience], curve[-patience:])
    )
    return since > (1.0 - MIN_GAIN) * before
