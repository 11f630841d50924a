"""Held-out missions: what the policy under training costs where it never trained."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float

from swarm_mj.evaluation.statistics import standard_error
from swarm_mj.learning.settings import HELD_OUT_SEED, Training
from swarm_mj.mission import Mission
from swarm_mj.policies.gnn.feature_sets import make_extractor
from swarm_mj.policies.gnn.network import AggregationGnn
from swarm_mj.policies.gnn.policy import LearnedPolicy
from swarm_mj.policies.policy import Policy
from swarm_mj.protocol.costs import WindowCosts
from swarm_mj.replay.recorder import Recorder
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm

Flown = list[list[WindowCosts]]  # by team size, window by window
MakePolicy = Callable[[Mission], Policy]


@dataclass(frozen=True, kw_only=True)
class HeldOut:
    """Means over held-out missions; over all team sizes, where there are several."""

    aoi: float  # Eq. 10 [windows]
    aoi_sem: float | None  # standard error over the missions [windows]; None of one mission
    aoi_steady: float  # over the second half of the missions [windows]
    velocity_variance: float  # Eq. 17 [m²/s²]
    packets_per_window: float
    delivery_ratio: float
    objective: float  # what the best policy has least of: the reward's cost, each size alike


def held_out_policy(training: Training, network: AggregationGnn, mission: Mission) -> LearnedPolicy:
    """Return the policy under training, as it flies."""
    extractor = make_extractor(training.features, mission)
    return LearnedPolicy(network, extractor, silence_logit=training.silence_logit)


def held_out_missions(training: Training) -> list[Mission]:
    """One for each team size."""
    return [replace(training.mission, num_robots=size) for size in training.robots]


def evaluate(
    training: Training,
    network: AggregationGnn,
    on_window: Callable[[float], None] = lambda _share: None,
) -> HeldOut:
    """What the held-out missions cost; draws nothing from the generators of the training.

    `on_window` is told after every window what share is flown; what it raises ends the evaluation.
    """
    seeds = seeds_from(HELD_OUT_SEED, training.held_out)
    flies = partial(held_out_policy, training, network)
    return means(training, fly(training, flies, seeds, on_window))


def seeds_from(first: int, size: int) -> range:
    """Of so many missions of each team size."""
    return range(first, first + size)


def means(training: Training, costs: Flown) -> HeldOut:
    """What missions flown cost, all team sizes together."""
    age = [np.array([window.age_windows for window in windows]) for windows in costs]
    variance = [np.array([w.velocity_variance_m2ps2 for w in windows]) for windows in costs]
    objective = [each / size for each, size in zip(age, training.robots, strict=True)]
    if training.reward == "velocity-variance":
        objective = variance
    packets = [window.packets for windows in costs for window in windows]
    attempted = sum(int(each.attempted.sum()) for each in packets)
    return HeldOut(
        aoi=_mean(age),
        aoi_sem=_standard_error([each.mean(axis=0) for each in age]),
        aoi_steady=_mean([each[len(each) // 2 :] for each in age]),
        velocity_variance=_mean(variance),
        packets_per_window=attempted / sum(each.size for each in age),
        delivery_ratio=sum(int(each.delivered.sum()) for each in packets) / max(1, attempted),
        objective=_mean(objective),
    )


def record_replay(
    training: Training, network: AggregationGnn, decisions: int, folder: Path
) -> None:
    """Record the first held-out mission, as the network flies it after so many team decisions."""
    from swarm_mj.replay.write import write_replay  # rerun takes its time to import

    mission = held_out_missions(training)[0]
    swarm = Swarm(mission, [HELD_OUT_SEED], **training.components.given)
    recorder = Recorder(swarm)
    for window in rollout(swarm, held_out_policy(training, network, mission)):
        recorder.add(window)
    write_replay(
        recorder.log(),
        mission,
        {"decisions": decisions, "seed": HELD_OUT_SEED, "training seed": training.seed},
        folder / f"decisions-{decisions:09d}.rrd",
    )


def fly(
    training: Training,
    policy_of: MakePolicy,
    seeds: range,
    on_window: Callable[[float], None] = lambda _share: None,
) -> Flown:
    """What missions of each team size cost with a policy; `on_window` as in `evaluate`."""
    missions = held_out_missions(training)
    sizes = []
    for mission in missions:
        swarm = Swarm(mission, seeds, **training.components.given)
        policy = policy_of(mission)
        sizes.append([])
        for window in range(1, mission.num_windows + 1):
            sizes[-1].append(swarm.step(policy))
            on_window((len(sizes) - 1 + window / mission.num_windows) / len(missions))
    return sizes


def own_costs(costs: Flown, cost: str) -> list[Float[np.ndarray, "B"]]:
    """What every mission flown costs, by team size: its `aoi`, or its `velocity_variance`."""
    name = "age_windows" if cost == "aoi" else "velocity_variance_m2ps2"
    return [np.mean([getattr(each, name) for each in windows], axis=0) for windows in costs]


def mean_and_error(by_size: Sequence[Float[np.ndarray, "B"]]) -> tuple[float, float | None]:
    """Over missions and team sizes: the mean, and its standard error if there is one."""
    return float(np.mean([each.mean() for each in by_size])), _standard_error(by_size)


def _mean(by_size: Sequence[Float[np.ndarray, "windows B"]]) -> float:
    return float(np.mean([each.mean() for each in by_size]))


def _standard_error(by_size: Sequence[Float[np.ndarray, "B"]]) -> float | None:
    """Return the standard error of the mean over sizes; sizes differ, but they are not drawn."""
    errors = [standard_error(each) for each in by_size]
    known = [error for error in errors if error is not None]
    return math.hypot(*known) / len(known) if len(known) == len(errors) else None
