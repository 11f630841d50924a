"""The state of a run: its learning curve, which of its policies is kept, when it stops learning.

The best of many noisy evaluations is biased. So the best few are flown again, on missions that
none of them was judged on, and the reported age is from a third set. `held_out` flies them.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

from swarm_mj.learning.settings import Training
from swarm_mj.protocol.costs import WindowCosts
from swarm_mj.protocol.mission_costs import AOI, MissionCost
from swarm_mj.protocol.packet_counts import arrived
from swarm_mj.system.writing import write_csv

ORACLE = "lookahead-oracle"
# Policies without a payload or training, and what each knows.
REFERENCES = {
    "tdma": "robots take turns that were agreed beforehand",
    "spatial-tdma": "robots that believe themselves far apart share a turn",
    ORACLE: "knows where all robots are and what they know, and plans ahead",
}
# Of runs that began with 1.0: they are compared with it as before, also when they are resumed.
FORMER_ORACLE = "greedy-oracle"
COMPARED = (*REFERENCES, FORMER_ORACLE)  # what a learning curve may have costs of
ORACLES = (ORACLE, FORMER_ORACLE)
# The oracle does not fly larger teams: a window takes it 1 ms at 40 robots, 26 ms at 200.
ORACLE_ROBOTS = 100
NUM_BEST = 3  # evaluations whose policies are flown again
OTHER_FLIGHTS = 2 + len(REFERENCES)  # at the end: the one that is kept, again, and the first
NEAR = 1.25  # times the least objective: worse policies have lost already
MAX_MISSIONS = 40  # of each kind, to choose
FLOWN_SHARE = 0.5  # of a run's decisions, for its choice; they cost less than learning
RESERVED_SHARE = 0.5  # of a run's minutes, at most, kept back for its choice
MIN_GAIN = 0.005  # of the objective, that counts as learning

Columns = dict[str, float]  # numbers by the names of the learning curve's columns
# Each held-out mission's cost, by the name of the curve's column, then by kind of mission.
References = dict[str, list[list[float]]]


@dataclass(frozen=True, kw_only=True)
class HeldOutCosts:
    """Costs of a policy on the held-out missions: means in which kinds of missions count alike."""

    aoi: float  # age of information [windows]
    aoi_sem: float | None = None  # its standard error over the missions; None of one mission
    aoi_steady: float  # age in the missions' second half [windows]
    velocity_variance: float  # [m²/s²]
    packets_per_window: float  # sent
    delivery_ratio: float  # of these
    objective: float  # by the reward's cost; the best policy has the least


@dataclass(frozen=True, kw_only=True)
class CurveRow:
    """A row of the learning curve: what one evaluation found."""

    decisions: int  # of teams, before it
    minutes: float  # before its end
    costs: HeldOutCosts
    # Costs of `COMPARED`, such as `aoi_tdma`, and how far behind them it is, `aoi_behind_tdma`.
    references: Columns = field(default_factory=dict)
    training: Columns = field(default_factory=dict)  # since the last one: `rollout/aoi` and others

    def columns(self) -> Columns:
        """Return the row as it is written, in the order of the columns."""
        row: Columns = {"decisions": float(self.decisions), "minutes": self.minutes}
        for name, value in asdict(self.costs).items():
            if value is not None:
                row[name] = value
        return row | self.references | self.training


def curve_row_of(row: Mapping[str, float]) -> CurveRow:
    """Return what `CurveRow.columns` was made of; raise KeyError if a column is missing."""
    left = dict(row)
    decisions = int(left.pop("decisions"))
    minutes = left.pop("minutes")
    costs: Columns = {}
    for spec in fields(HeldOutCosts):
        if spec.name in left or spec.name != "aoi_sem":
            costs[spec.name] = left.pop(spec.name)
    references: Columns = {}
    training: Columns = {}
    for name, value in left.items():
        # A slash makes a group in TensorBoard, which is where what is of training goes.
        if "/" in name:
            training[name] = value
        else:
            references[name] = value
    return CurveRow(
        decisions=decisions,
        minutes=minutes,
        costs=HeldOutCosts(**costs),
        references=references,
        training=training,
    )


@dataclass(frozen=True, kw_only=True)
class Cost:
    """A policy's age of information [windows], or its velocity variance [m²/s²]."""

    mean: float
    sem: float | None  # None of one mission
    behind: float = 0.0  # how much more the policy that is kept costs on the same missions
    behind_sem: float | None = None


@dataclass(frozen=True, kw_only=True)
class Choice:
    """The policy that is kept, and its cost on missions that did not choose it."""

    decisions: int  # of teams, that it learned from
    run_decisions: int  # that the run had made when it was chosen
    num_finalists: int
    num_missions: int  # of each kind that chose it, and as many others that tell its cost
    kept: Cost
    others: dict[str, Cost]  # on the same missions: those of `REFERENCES` that fly, and `first`


@dataclass(kw_only=True)
class Accumulator:
    """Costs of the missions in training since the last evaluation.

    The logger's own means would not survive an interruption: these are in the checkpoint.
    """

    seconds: float = 0.0
    decisions: int = 0  # of teams
    age_windows: float = 0.0  # summed over the decisions
    attempted: int = 0  # packets
    delivered: int = 0

    def add(self, batches: Iterable[WindowCosts]) -> None:
        """Add a window of all missions, but no time."""
        for costs in batches:
            self.decisions += len(costs.age_windows)
            self.age_windows += float(costs.age_windows.sum())
            packets = costs.packets
            self.attempted += int(packets.sent.sum())
            self.delivered += int(arrived(packets.delivered, packets.heard).sum())

    def means(self) -> Columns:
        """Return means per mission and window; none before the first."""
        if not self.decisions:
            return {}
        return {
            "rollout/aoi": self.age_windows / self.decisions,
            "rollout/packets_per_window": self.attempted / self.decisions,
            "rollout/delivery_ratio": self.delivered / max(1, self.attempted),
            "rollout/decisions_per_s": self.decisions / max(self.seconds, 1e-9),
        }


@dataclass(kw_only=True)
class Progress:
    """The state of a run, but for its weights and missions."""

    decisions: int = 0  # of teams, in all sessions
    minutes: float = 0.0  # in all sessions, evaluations included
    next_replay: int = 0  # team decisions
    curve: list[CurveRow] = field(default_factory=list)
    since_evaluation: Accumulator = field(default_factory=Accumulator)
    optimiser: Columns = field(default_factory=dict)  # what the optimiser last said of itself
    choice: Choice | None = None  # of the policy that is kept; None: it is of the best evaluation
    evaluation_minutes: float = 0.0  # that the last one took
    references: References = field(default_factory=dict)  # flown once; none in runs of 1.0.0

    @property
    def has_chosen(self) -> bool:
        """True if the kept policy was selected after the last training step."""
        return self.choice is not None and self.choice.run_decisions == self.decisions

    @property
    def best(self) -> CurveRow | None:
        """The best evaluation."""
        return min(self.curve, key=objective_of, default=None)

    def is_due(self, every: int) -> bool:
        """Return whether another interval of as many decisions began since the last evaluation."""
        last = self.curve[-1].decisions if self.curve else -1
        return self.decisions // every > last // every

    def has_stalled(self, patience: int | None) -> bool:
        """Return whether the last `patience` evaluations brought no gain; never with None or 0."""
        if not patience or len(self.curve) <= patience:
            return False
        least_before = min(map(objective_of, self.curve[:-patience]))
        least = min(map(objective_of, self.curve[-patience:]))
        return least > (1.0 - MIN_GAIN) * least_before

    def write_curve(self, path: Path) -> None:
        """Write the learning curve; later rows may have more columns."""
        columns: dict[str, None] = {}  # in order, each once
        rows = [evaluation.columns() for evaluation in self.curve]
        for row in rows:
            columns |= dict.fromkeys(row)
        write_csv(path, list(columns), rows)


@dataclass(frozen=True, kw_only=True)
class Status:
    """A run's state after a window of training or of an evaluation, for listeners."""

    progress: Progress  # the run's own, so only to be read
    aoi: float = math.nan  # of the missions in training, in the last window [windows]
    evaluated: float | None = None  # the share of an evaluation that is flown; None while training
    what: str = "Training"  # or what is flown


# Returns whether to go on; if not, the rollout is finished, or the evaluation left for later.
Listener = Callable[[Status], bool]


def objective_of(evaluation: CurveRow) -> float:
    """Return what is minimised."""
    return evaluation.costs.objective


def column(cost: MissionCost, name: str) -> str:
    """Return the learning curve's column for a cost of a policy of `COMPARED`."""
    return f"{cost.column}_{name}".replace("-", "_")


def reference_ages(row: Mapping[str, float]) -> dict[str, float]:
    """Return the ages of those of `COMPARED` that a row has, by their names [windows]."""
    ages: dict[str, float] = {}
    for name in COMPARED:
        age = row.get(column(AOI, name))
        if age is not None:
            ages[name] = age
    return ages


def reached(curve: Sequence[CurveRow], name: str) -> CurveRow | None:
    """Return the first evaluation whose age was at most that of one of `COMPARED`, if any was.

    None, too, if that one was not flown.
    """
    for row in curve:
        age = reference_ages(row.references).get(name)
        if age is not None and row.costs.aoi <= age:
            return row
    return None


def behind_column(name: str) -> str:
    """Return the curve's column for how much older than one of `COMPARED` a policy's news is."""
    return column(AOI, f"behind_{name}")


def references_flown(training: Training) -> list[str]:
    """Return those of `REFERENCES` that fly a training's missions beside its policies."""
    is_large = training.most_robots > ORACLE_ROBOTS
    return [name for name in REFERENCES if not (is_large and name == ORACLE)]


def differences(row: Mapping[str, float]) -> dict[str, Cost]:
    """Return the references' ages and how far behind them, pair by pair, a row's policy is.

    A row of 1.0.0 has no differences, and of one mission a difference has no error.
    """
    compared: dict[str, Cost] = {}
    for name, age in reference_ages(row).items():
        behind = row.get(behind_column(name))
        if behind is not None:
            sem = row.get(f"{behind_column(name)}_sem")
            compared[name] = Cost(mean=age, sem=None, behind=behind, behind_sem=sem)
    return compared


def candidates(curve: Sequence[CurveRow]) -> list[CurveRow]:
    """Return evaluations whose policies may be chosen: the best few, and the first, the start."""
    best = sorted(curve, key=objective_of)[:NUM_BEST]
    return [row for row in curve if row in best or row is curve[0]]


def finalists(curve: Sequence[CurveRow]) -> list[CurveRow]:
    """Return candidates that may be the best in truth, though not on the held-out missions."""
    rows = candidates(curve)
    near = NEAR * min(map(objective_of, rows))
    return [row for row in rows if objective_of(row) <= near]


def num_missions(training: Training, decisions: int, num_flights: int) -> int:
    """Return the missions of each kind that a flight has at the end.

    All flights together take up to a share of the run, but each has at least the missions of an
    evaluation: fewer would tell less than is known already.
    """
    windows = num_flights * len(training.kinds) * training.mission.num_windows
    within = int(FLOWN_SHARE * decisions / windows)
    return max(training.held_out, min(MAX_MISSIONS, within))


def reserved_minutes(training: Training, progress: Progress, limit: float) -> float:
    """Return the part of a run's minutes that its last evaluation and its choice will take."""
    num_flights = NUM_BEST + 1 + OTHER_FLIGHTS
    missions = num_flights * num_missions(training, progress.decisions, num_flights)
    needed = progress.evaluation_minutes * (1 + missions / training.held_out)
    return min(needed, RESERVED_SHARE * limit)
