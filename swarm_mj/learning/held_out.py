"""How a network flies missions that training never sees."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from jaxtyping import Float

from swarm_mj.evaluation.statistics import standard_error
from swarm_mj.gnn.feature_sets import make_extractor
from swarm_mj.gnn.network import AggregationGnn
from swarm_mj.learning.settings import HELD_OUT_SEED, Training
from swarm_mj.mission import Mission
from swarm_mj.policies.gnn import LearnedPolicy
from swarm_mj.swarm import Swarm


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

    def to_json(self) -> dict[str, float | None]:
        """All numbers by name."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class _Flown:
    """What held-out missions of one team size cost, window by window."""

    age_windows: Float[np.ndarray, "windows B"]
    velocity_variance_m2ps2: Float[np.ndarray, "windows B"]
    attempted: Float[np.ndarray, "windows B"]
    delivered: Float[np.ndarray, "windows B"]


def held_out_policy(training: Training, network: AggregationGnn, mission: Mission) -> LearnedPolicy:
    """The policy under training, as it flies."""
    extractor = make_extractor(training.features, mission)
    return LearnedPolicy(network, extractor, silence_logit=training.silence_logit)


def held_out_missions(training: Training) -> list[Mission]:
    """One for each team size."""
    return [replace(training.mission, num_robots=size) for size in training.robots]


def evaluate(
    training: Training,
    network: AggregationGnn,
    on_window: Callable[[float], None] = lambda share: None,  # noqa: ARG005
) -> HeldOut:
    """Flies the held-out missions; draws nothing from the generators of the training.

    Args:
        training: Names the missions.
        network: That acts, on any device.
        on_window: Told after every window what share is flown; what it raises ends the evaluation.

    Returns:
        What they cost.
    """
    missions = held_out_missions(training)
    flown = [
        _fly(training, network, mission, lambda share, n=n: on_window((n + share) / len(missions)))
        for n, mission in enumerate(missions)
    ]
    age = [each.age_windows for each in flown]
    variance = [each.velocity_variance_m2ps2 for each in flown]
    objective = [each / size for each, size in zip(age, training.robots, strict=True)]
    if training.reward == "velocity-variance":
        objective = variance
    attempted = sum(int(each.attempted.sum()) for each in flown)
    return HeldOut(
        aoi=_mean(age),
        aoi_sem=_standard_error([each.mean(axis=0) for each in age]),
        aoi_steady=_mean([each[len(each) // 2 :] for each in age]),
        velocity_variance=_mean(variance),
        packets_per_window=attempted / sum(each.size for each in age),
        delivery_ratio=sum(int(each.delivered.sum()) for each in flown) / max(1, attempted),
        objective=_mean(objective),
    )


def _fly(
    training: Training,
    network: AggregationGnn,
    mission: Mission,
    on_window: Callable[[float], None],
) -> _Flown:
    swarm = Swarm(mission, range(HELD_OUT_SEED, HELD_OUT_SEED + training.held_out))
    policy = held_out_policy(training, network, mission)
    windows = []
    for window in range(mission.num_windows):
        windows.append(swarm.step(policy))
        on_window((window + 1) / mission.num_windows)
    return _Flown(
        age_windows=np.array([each.age_windows for each in windows]),
        velocity_variance_m2ps2=np.array([each.velocity_variance_m2ps2 for each in windows]),
        attempted=np.array([each.packets.attempted for each in windows]),
        delivered=np.array([each.packets.delivered for each in windows]),
    )


def _mean(by_size: Sequence[Float[np.ndarray, "windows B"]]) -> float:
    return float(np.mean([each.mean() for each in by_size]))


def _standard_error(by_size: Sequence[Float[np.ndarray, "B"]]) -> float | None:
    """Of the mean over sizes; sizes differ, but they are not drawn."""
    errors = [standard_error(each) for each in by_size]
    known = [error for error in errors if error is not None]
    return math.hypot(*known) / len(known) if len(known) == len(errors) else None
