"""How a network flies missions that training never sees."""

from dataclasses import asdict, dataclass, replace

import numpy as np

from swarm_mj.gnn import AggregationGnn
from swarm_mj.graphs.observers import make_observer
from swarm_mj.learning.settings import HELD_OUT_SEED, Training
from swarm_mj.mission import Mission
from swarm_mj.policies.learned import LearnedPolicy
from swarm_mj.swarm import Swarm


@dataclass(frozen=True, kw_only=True)
class HeldOut:
    """Means over held-out missions; over all team sizes, where there are several."""

    aoi: float  # Eq. 10 [windows]
    aoi_sem: float  # standard error over the missions [windows]
    aoi_steady: float  # over the second half of the missions [windows]
    velocity_variance: float  # Eq. 17 [m²/s²]
    packets_per_window: float
    delivery_ratio: float
    objective: float  # what the best policy has least of: the reward's cost, each size alike

    def to_json(self) -> dict[str, float]:
        """All numbers by name."""
        return asdict(self)


def held_out_policy(training: Training, network: AggregationGnn, mission: Mission) -> LearnedPolicy:
    """The policy under training, as it flies."""
    observer = make_observer(training.features, mission)
    return LearnedPolicy(network, observer, silence_logit=training.silence_logit)


def held_out_missions(training: Training) -> list[Mission]:
    """One for each team size."""
    return [replace(training.mission, num_robots=size) for size in training.robots]


def evaluate(training: Training, network: AggregationGnn) -> HeldOut:
    """Flies the held-out missions; draws nothing from the generators of the training.

    Args:
        training: Names the missions.
        network: That acts.

    Returns:
        What they cost.
    """
    seeds = range(HELD_OUT_SEED, HELD_OUT_SEED + training.held_out)
    costs = []
    for mission in held_out_missions(training):
        swarm = Swarm(mission, seeds)
        policy = held_out_policy(training, network, mission)
        windows = [swarm.step(policy) for _ in range(mission.num_windows)]
        costs.append(
            (
                np.array([window.age_windows for window in windows]),
                np.array([window.velocity_variance_m2ps2 for window in windows]),
                np.array([window.packets.attempted for window in windows]),
                np.array([window.packets.delivered for window in windows]),
            )
        )
    age, variance, attempted, delivered = ([each[n] for each in costs] for n in range(4))
    by_mission = np.concatenate([each.mean(axis=0) for each in age])
    objective = [each.mean() / size for each, size in zip(age, training.robots, strict=True)]
    if training.reward == "velocity-variance":
        objective = [each.mean() for each in variance]
    return HeldOut(
        aoi=float(by_mission.mean()),
        aoi_sem=float(by_mission.std() / np.sqrt(by_mission.size)),
        aoi_steady=float(np.mean([each[len(each) // 2 :].mean() for each in age])),
        velocity_variance=float(np.mean([each.mean() for each in variance])),
        packets_per_window=float(np.mean([each.mean() for each in attempted])),
        delivery_ratio=float(
            sum(each.sum() for each in delivered) / max(1, sum(each.sum() for each in attempted))
        ),
        objective=float(np.mean(objective)),
    )
