"""Flights that compare: the hand-written policies on held-out missions, and the choice at the end.

Nothing here draws from the generators of the training, and the same weights choose the same.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float

from swarm_mj.learning.choice import (
    CHOICE_SEED,
    COMPARED,
    JUDGED,
    NEAR,
    OTHER_FLIGHTS,
    REFERENCES,
    TEST_SEED,
    Choice,
    Cost,
    Row,
    column,
    finalists,
    num_missions,
    reference_missions,
)
from swarm_mj.learning.held_out import (
    HeldOut,
    MakePolicy,
    fly,
    held_out_policy,
    mean_and_error,
    means,
    own_costs,
    seeds_from,
)
from swarm_mj.learning.settings import HELD_OUT_SEED, Training
from swarm_mj.policies.gnn.network import AggregationGnn
from swarm_mj.policies.registry import make_policy

REFERENCE_COLUMNS = [column(cost, name) for cost in JUDGED for name in REFERENCES]
OnWindow = Callable[[float], None]
Samples = list[Float[np.ndarray, "B"]]  # by team size


def reference_columns(training: Training, on_window: OnWindow) -> Row:
    """What `REFERENCES` cost on held-out missions, by the learning curve's columns."""
    columns, its_missions = {}, reference_missions(training)
    for n, (name, size) in enumerate(its_missions.items()):
        share = partial(_share_of, on_window, n, len(its_missions))
        seeds = seeds_from(HELD_OUT_SEED, size)
        flown = fly(training, partial(make_policy, name), seeds, share)
        for cost in JUDGED:
            columns[column(cost, name)] = mean_and_error(own_costs(flown, cost))[0]
    return columns


def told_of_evaluation(training: Training) -> dict[str, Any]:
    """For the card of a policy that is the best of the evaluations."""
    return {
        "missions": training.held_out * len(training.robots),
        "first_seed": HELD_OUT_SEED,
        "chosen_by": "the least objective of all evaluations on these same missions",
    }


def told_of_choice(training: Training, choice: Choice) -> dict[str, Any]:
    """For the card of a policy that was chosen at the end."""
    how = f"the least objective of all evaluations; no other was within {NEAR - 1.0:.0%} of it"
    if choice.num_finalists > 1:
        how = (
            f"the least objective of {choice.num_finalists} of the best policies on as many other "
            f"missions, from seed {CHOICE_SEED}"
        )
    return {
        "missions": choice.num_missions * len(training.robots),
        "first_seed": TEST_SEED,
        "chosen_by": how,
        "others_on_these_missions": {name: asdict(cost) for name, cost in choice.others.items()},
    }


def choose(
    training: Training,
    curve: Sequence[Row],
    networks: Mapping[int, AggregationGnn],
    on_window: OnWindow,
) -> tuple[Choice, HeldOut]:
    """Chooses among the finalists on fresh missions, and tells the cost on others.

    Args:
        training: The settings.
        curve: Of the whole run.
        networks: The candidates', by the decisions that they learned from.
        on_window: Told after every window what share is flown; what it raises ends the choice.

    Returns:
        The choice, and all that it costs.
    """
    rows, run_decisions = finalists(curve), int(curve[-1]["decisions"])
    num_flights = len(rows) + OTHER_FLIGHTS  # at most
    size = num_missions(training, run_decisions, num_flights)
    told = (partial(_share_of, on_window, n, num_flights) for n in range(num_flights))

    def flies(row: Row) -> MakePolicy:
        return partial(held_out_policy, training, networks[int(row["decisions"])])

    kept, seeds = rows[0], seeds_from(CHOICE_SEED, size)
    if len(rows) > 1:
        flown = [fly(training, flies(row), seeds, next(told)) for row in rows]
        objectives = [means(training, costs).objective for costs in flown]
        kept = rows[int(np.argmin(objectives))]
    seeds = seeds_from(TEST_SEED, size)
    costs = fly(training, flies(kept), seeds, next(told))
    own = own_costs(costs, training.cost)
    compared: dict[str, MakePolicy] = {name: partial(make_policy, name) for name in COMPARED}
    if kept is not curve[0]:
        compared["first"] = flies(curve[0])
    others = {
        name: own_costs(fly(training, policy_of, seeds, next(told)), training.cost)
        for name, policy_of in compared.items()
    }
    mean, sem = mean_and_error(own)
    choice = Choice(
        decisions=int(kept["decisions"]),
        run_decisions=run_decisions,
        num_finalists=len(rows),
        num_missions=size,
        kept=Cost(mean=mean, sem=sem),
        others={name: _compared(own, each) for name, each in others.items()},
    )
    return choice, means(training, costs)


def _compared(own: Samples, other: Samples) -> Cost:
    """Another policy's cost, and how far the policy that is kept is behind it, pair by pair."""
    mean, sem = mean_and_error(other)
    behind, behind_sem = mean_and_error([a - b for a, b in zip(own, other, strict=True)])
    return Cost(mean=mean, sem=sem, behind=behind, behind_sem=behind_sem)


def _share_of(on_window: OnWindow, n: int, total: int, share: float) -> None:
    """Tells the share of all flights, in the n-th of them."""
    on_window((n + share) / total)
