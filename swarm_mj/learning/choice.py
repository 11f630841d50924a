"""Which policy of a run is kept, and when a run no longer learns: decided from its curve alone.

The least of many evaluations on the same few missions flatters: part of its lead is luck. So the
best few are flown again, on missions that none of them was judged on, and the age that is told is
from others again.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta

from swarm_mj.learning.settings import Training

# Policies without a payload or training, and what each knows.
REFERENCES = {
    "tdma": "robots take turns that were agreed beforehand",
    "spatial-tdma": "robots that believe themselves far apart share a turn",
    "greedy-oracle": "knows where all robots are and what they know",
}
COMPARED = ("tdma", "spatial-tdma")  # at the end, too: the oracle takes longer than the network
JUDGED = ("aoi", "velocity_variance")  # costs that a run can lower
CHOICE_SEED = 510_000  # of the first mission that chooses; held-out ones end below
TEST_SEED = 520_000  # of the first that tells the age of what was chosen
NUM_BEST = 3  # evaluations whose policies are flown again
NEAR = 1.25  # times the least objective: what is worse than that has lost already
MOST_MISSIONS = 40  # of each team size, to choose
FLOWN_SHARE = 0.5  # of a run's decisions, that its choice may take; they cost less than learning
MANY_DECISIONS = 10**12
LEAST_GAIN = 0.005  # of the objective, that counts as learning

# What is allowed where a run's progress is read back.
Count = Annotated[int, Meta(ge=0, le=2**62)]
Amount = Annotated[float, Meta(ge=0.0, le=1e30)]
Row = dict[str, float]


@dataclass(frozen=True, kw_only=True)
class Cost:
    """What a policy costs: its age of information [windows], or its velocity variance [m²/s²]."""

    mean: Amount
    sem: Amount | None  # None of one mission
    behind: float = 0.0  # how much more the policy that is kept costs on the same missions
    behind_sem: Amount | None = None


@dataclass(frozen=True, kw_only=True)
class Choice:
    """The policy that is kept, and what it costs on missions that did not choose it."""

    decisions: Count  # of teams, that it learned from
    run_decisions: Count  # that the run had made when it was chosen
    num_finalists: Count
    num_missions: Count  # of each team size that chose it, and as many others that tell its cost
    kept: Cost
    others: dict[str, Cost]  # on the same missions: `COMPARED`, and `first`


def column(cost: str, name: str) -> str:
    """Where a learning curve has what a policy of `REFERENCES` costs."""
    return f"{cost}_{name.replace('-', '_')}"


def candidates(curve: Sequence[Row]) -> list[Row]:
    """Evaluations whose policies may be chosen: the best few, and the first, of what was given."""
    best = sorted(curve, key=lambda row: row["objective"])[:NUM_BEST]
    return [row for row in curve if row in best or row is curve[0]]


def finalists(curve: Sequence[Row]) -> list[Row]:
    """Candidates that may be the best in truth, though not on the held-out missions."""
    rows = candidates(curve)
    near = NEAR * min(row["objective"] for row in rows)
    return [row for row in rows if row["objective"] <= near]


def num_missions(training: Training, decisions: int, num_flights: int) -> int:
    """Missions of each team size that a policy of so many flies, within a share of the run."""
    windows = num_flights * len(training.robots) * training.mission.num_windows
    within = int(FLOWN_SHARE * decisions / windows)
    return max(training.held_out, min(MOST_MISSIONS, within))


def has_stalled(curve: Sequence[Row], patience: int | None) -> bool:
    """Whether the last evaluations, `patience` of them, brought nothing better; never with None."""
    if not patience or len(curve) <= patience:
        return False
    before, since = (
        min((row["objective"] for row in rows), default=math.inf)
        for rows in (curve[:-patience], curve[-patience:])
    )
    return since > (1.0 - LEAST_GAIN) * before
