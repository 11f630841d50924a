"""Flights on missions without training: evaluations, the choice of the policy that is kept.

Nothing here draws from the generators of the training: the same weights cost and choose the same.
Functions that fly call `on_window` after every window with the share flown; what it raises ends
the flight.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from swarm_mj.evaluation.batch import BatchCosts, costs_of
from swarm_mj.evaluation.samples import standard_error
from swarm_mj.learning import selection
from swarm_mj.learning.selection import (
    NEAR,
    OTHER_FLIGHTS,
    Choice,
    Columns,
    Cost,
    CurveRow,
    HeldOutCosts,
    References,
)
from swarm_mj.learning.settings import (
    CHOICE_SEED,
    HELD_OUT_SEED,
    LEARNED_COSTS,
    TEST_SEED,
    Training,
)
from swarm_mj.mission import Mission
from swarm_mj.policies.gnn.feature_sets import make_extractor
from swarm_mj.policies.gnn.network import Network
from swarm_mj.policies.gnn.policy import GnnPolicy
from swarm_mj.policies.index.policy import IndexCsma
from swarm_mj.policies.index.weights import Weights
from swarm_mj.policies.policy import Policy
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.mission_costs import AOI, VELOCITY_VARIANCE, MissionCost
from swarm_mj.protocol.packet_counts import arrived
from swarm_mj.replay.recorder import Recorder
from swarm_mj.simulation.rollout import WindowRecord, rollout
from swarm_mj.simulation.swarm import Swarm

CostsByKind = list[BatchCosts]  # by kind of mission
Samples = list[Float[np.ndarray, "B"]]  # by kind of mission
Acting = Network | Weights  # what is trained, and decides
MakePolicy = Callable[[Mission], Policy]
OnWindow = Callable[[float], None]


@dataclass(kw_only=True)
class Flights:
    """Flights one after the other, which report the share of all of them after every window."""

    training: Training
    on_window: OnWindow
    total: int = 1  # flights, at most
    num_windows: int = 0  # flown

    def fly(self, make_flown: MakePolicy, first_seed: int, num_missions: int) -> CostsByKind:
        """Fly as many missions of each kind, from a seed on; return their costs."""
        flown: CostsByKind = []
        for mission in self.training.kinds:
            seeds = range(first_seed, first_seed + num_missions)
            swarm = Swarm(mission, seeds, **self.training.components.given)
            flown.append(costs_of(swarm, self._reported(rollout(swarm, make_flown(mission)))))
        return flown

    def _reported(self, flown: Iterator[WindowRecord]) -> Iterator[WindowRecord]:
        in_all = self.total * len(self.training.kinds) * self.training.mission.num_windows
        for window in flown:
            yield window
            self.num_windows += 1
            self.on_window(self.num_windows / in_all)


def held_out_policy(training: Training, acting: Acting, mission: Mission) -> Policy:
    """Return the policy under training, as it flies."""
    if isinstance(acting, Weights):
        return IndexCsma(mission, acting)
    extractor = make_extractor(training.features, mission)
    return GnnPolicy(
        acting,
        extractor,
        silence_logit=training.silence_logit,
        most_speech=training.most_speech,
    )


def evaluate(
    training: Training,
    acting: Acting,
    references: References | None = None,
    on_window: OnWindow = lambda _share: None,
) -> tuple[HeldOutCosts, Columns]:
    """Fly the held-out missions.

    Args:
        training: The settings of the run.
        acting: The network or the index that flies; its weights are not changed.
        references: What `fly_references` has returned: policies to compare with, pair by pair.
        on_window: It is called after every window with the share flown.

    Returns:
        The missions' mean costs; and, by the curve's columns, how much older than each reference's
        the news is on the same missions, with its standard error.
    """
    flights = Flights(training=training, on_window=on_window)
    make_acting = partial(held_out_policy, training, acting)
    flown = flights.fly(make_acting, HELD_OUT_SEED, training.held_out)
    ages = _samples(flown, AOI)
    behind: Columns = {}
    for name in selection.COMPARED:
        theirs = (references or {}).get(selection.column(AOI, name))
        if theirs is not None:
            compared = _compared([np.array(each) for each in theirs], ages)
            behind[selection.behind_column(name)] = compared.behind
            if compared.behind_sem is not None:
                behind[f"{selection.behind_column(name)}_sem"] = compared.behind_sem
    return _means(training, flown), behind


def fly_references(training: Training, on_window: OnWindow) -> References:
    """Fly `REFERENCES` on the held-out missions, as all evaluations do; return their costs."""
    references: References = {}
    names = selection.references_flown(training)
    flights = Flights(training=training, on_window=on_window, total=len(names))
    for name in names:
        flown = flights.fly(partial(make_policy, name), HELD_OUT_SEED, training.held_out)
        for cost in LEARNED_COSTS:
            samples = _samples(flown, cost)
            references[selection.column(cost, name)] = [each.tolist() for each in samples]
    return references


def reference_columns(references: References) -> Columns:
    """Return the mean costs of references by the curve's columns."""
    columns: Columns = {}
    for name, by_kind in references.items():
        columns[name] = _mean([np.array(each) for each in by_kind])
    return columns


def choose(
    training: Training,
    curve: Sequence[CurveRow],
    candidates: Mapping[int, Acting],  # by the decisions behind them
    on_window: OnWindow,
) -> tuple[Choice, HeldOutCosts]:
    """Choose among the finalists of a whole run on fresh missions; return its cost on others."""
    rows = selection.finalists(curve)
    run_decisions = curve[-1].decisions
    flights = Flights(training=training, on_window=on_window, total=len(rows) + OTHER_FLIGHTS)
    size = selection.num_missions(training, run_decisions, flights.total)

    def maker_of(row: CurveRow) -> MakePolicy:
        return partial(held_out_policy, training, candidates[row.decisions])

    def objective(row: CurveRow) -> float:
        return _means(training, flights.fly(maker_of(row), CHOICE_SEED, size)).objective

    kept = min(rows, key=objective) if len(rows) > 1 else rows[0]
    costs = flights.fly(maker_of(kept), TEST_SEED, size)
    own = _samples(costs, training.cost)
    compared: dict[str, MakePolicy] = {}
    for name in selection.references_flown(training):
        compared[name] = partial(make_policy, name)
    if kept is not curve[0]:
        compared["first"] = maker_of(curve[0])
    others: dict[str, Cost] = {}
    for name, make_compared in compared.items():
        samples = _samples(flights.fly(make_compared, TEST_SEED, size), training.cost)
        others[name] = _compared(samples, own)
    choice = Choice(
        decisions=kept.decisions,
        run_decisions=run_decisions,
        num_finalists=len(rows),
        num_missions=size,
        kept=Cost(mean=_mean(own), sem=_standard_error(own)),
        others=others,
    )
    return choice, _means(training, costs)


def notes_of(training: Training, choice: Choice | None) -> dict[str, Any]:
    """Return the card's notes on how a policy was chosen; None: by the evaluations so far."""
    if choice is None:
        return {
            "missions": training.held_out * len(training.kinds),
            "first_seed": HELD_OUT_SEED,
            "chosen_by": "the least objective of all evaluations on these same missions",
        }
    how = f"the least objective of all evaluations; no other was within {NEAR - 1.0:.0%} of it"
    if choice.num_finalists > 1:
        how = (
            f"the least objective of {choice.num_finalists} of the best policies on as many other "
            f"missions, from seed {CHOICE_SEED}"
        )
    return {
        "missions": choice.num_missions * len(training.kinds),
        "first_seed": TEST_SEED,
        "chosen_by": how,
        "others_on_these_missions": {name: asdict(cost) for name, cost in choice.others.items()},
    }


def record_first(training: Training, acting: Acting, on_window: OnWindow) -> Recorder:
    """Fly the first held-out mission, as evaluations do; return its record."""
    mission = training.kinds[0]
    swarm = Swarm(mission, [HELD_OUT_SEED], **training.components.given)
    recorder = Recorder(swarm)
    for window in rollout(swarm, held_out_policy(training, acting, mission)):
        recorder.add(window)
        on_window(recorder.num_windows / mission.num_windows)
    return recorder


def recorded_of(training: Training, decisions: int) -> dict[str, int]:
    """Return what such a record is of, after this many team decisions: a replay's properties."""
    return {"decisions": decisions, "seed": HELD_OUT_SEED, "training seed": training.seed}


def record_replay(training: Training, acting: Acting, decisions: int, folder: Path) -> None:
    """Record the first held-out mission, as it is flown after this many team decisions."""
    from swarm_mj.replay.write import write_replay  # rerun is slow to import

    recorder = record_first(training, acting, lambda _share: None)
    about = recorded_of(training, decisions)
    write_replay(recorder.log(about), about, folder / f"decisions-{decisions:09d}.rrd")


def _means(training: Training, costs: CostsByKind) -> HeldOutCosts:
    age = _samples(costs, AOI)
    variance = _samples(costs, VELOCITY_VARIANCE)
    if training.cost is AOI:
        # Ages grow with the team; divided by its size, no size outweighs the others.
        sizes = [mission.num_robots for mission in training.kinds]
        objective = [of_kind / n for of_kind, n in zip(age, sizes, strict=True)]
    else:
        objective = variance
    sent = sum(float(each.packets_sent.sum()) for each in costs)
    delivered = 0.0
    for each in costs:
        delivered += float(arrived(each.packets_delivered, each.packets_heard).sum())
    num_windows = training.mission.num_windows * sum(each.aoi.size for each in costs)
    return HeldOutCosts(
        aoi=_mean(age),
        aoi_sem=_standard_error(age),
        aoi_steady=_mean([each.aoi_steady for each in costs]),
        velocity_variance=_mean(variance),
        packets_per_window=sent / num_windows,
        delivery_ratio=delivered / max(1.0, sent),
        objective=_mean(objective),
    )


def _samples(costs: CostsByKind, cost: MissionCost) -> Samples:
    """Return each mission's cost, by kind of mission."""
    return [each.of(cost) for each in costs]


def _compared(samples: Samples, kept: Samples) -> Cost:
    """Return a policy's cost and, pair by pair, how far the policy that is kept is behind it."""
    behind = [a - b for a, b in zip(kept, samples, strict=True)]
    return Cost(
        mean=_mean(samples),
        sem=_standard_error(samples),
        behind=_mean(behind),
        behind_sem=_standard_error(behind),
    )


def _mean(by_kind: Samples) -> float:
    return float(np.mean([each.mean() for each in by_kind]))


def _standard_error(by_kind: Samples) -> float | None:
    # Kinds differ, but they are not drawn: the errors of their means add up.
    errors = [standard_error(each) for each in by_kind]
    known = [error for error in errors if error is not None]
    return math.hypot(*known) / len(known) if len(known) == len(errors) else None
