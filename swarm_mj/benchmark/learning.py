"""How fast the paper's network decides, on its own and for a team, and how fast both arms train."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Int
from stable_baselines3.common.callbacks import BaseCallback

from swarm_mj.benchmark.simulation import microseconds
from swarm_mj.gnn.fast import FastAggregationGnn
from swarm_mj.gnn.feature_sets import make_extractor
from swarm_mj.gnn.graphs import Graphs, PaperFeatures
from swarm_mj.gnn.shape import GnnShape
from swarm_mj.learning.settings import arm_settings
from swarm_mj.learning.train import make_model
from swarm_mj.mission import Mission, paper
from swarm_mj.policies.round_robin import RoundRobin
from swarm_mj.swarm import Swarm

NUM_ROBOTS = 40
WARM_UP_WINDOWS = 100  # after which most robots know most others
SHAPE = GnnShape(num_features=len(PaperFeatures.names))  # the paper's


@dataclass(frozen=True, kw_only=True)
class NetworkTiming:
    """The paper's network (K = 5, width 64) on the CPU.

    The yardstick is a plain product of the same numbers: as many rows as the network has nodes,
    through one 64 by 64 layer, in the same run.
    """

    num_missions: int
    forward_per_s: float  # team decisions
    backward_per_s: float  # team decisions, forward included
    layer_us: float  # one layer over all nodes of a team, the yardstick

    @property
    def forward_in_layers(self) -> float:
        """A team's decision in such layers."""
        return 1e6 / self.forward_per_s / self.layer_us


@dataclass(frozen=True, kw_only=True)
class LearningTiming:
    """How fast learning and deciding are at 40 stationary robots."""

    networks: tuple[NetworkTiming, ...]
    own_decision_us: dict[str, float]  # one robot's network on its own graph, by what it is
    training_per_s: dict[str, float]  # team decisions, rollouts and optimisation, by arm


def bench_learning(
    *, num_robots: int = NUM_ROBOTS, threads: int = 1, seconds: float = 2.0
) -> LearningTiming:
    """Times the networks and the arms; no weights are kept.

    Args:
        num_robots: N.
        threads: torch's.
        seconds: About how long each measurement takes [s].

    Returns:
        The timing.
    """
    torch.set_num_threads(threads)
    mission = paper("stationary", num_robots=num_robots)
    robot = arm_settings("robot", mission, (num_robots,))
    own = {"arm robot's": (robot.network, robot.features), "the paper's": (SHAPE, "paper")}
    return LearningTiming(
        networks=tuple(_network_timing(mission, missions, seconds) for missions in (1, 32)),
        own_decision_us={
            name: _own_decision_us(mission, shape, features, seconds)
            for name, (shape, features) in own.items()
        },
        training_per_s={
            arm: _training_per_s(arm, mission, threads, seconds) for arm in ("robot", "team")
        },
    )


def _network_timing(mission: Mission, num_missions: int, seconds: float) -> NetworkTiming:
    network = FastAggregationGnn(SHAPE)
    node, parent = _tensors(_graphs(mission, "paper", num_missions))
    layer = torch.nn.Linear(SHAPE.latent, SHAPE.latent)
    rows = torch.randn(node.shape[0] * node.shape[1], SHAPE.latent)

    def learn() -> None:
        network(node, parent).sum().backward()

    forward_us = microseconds(_inferring(lambda: network(node, parent)), seconds)
    return NetworkTiming(
        num_missions=num_missions,
        forward_per_s=1e6 * num_missions / forward_us,
        backward_per_s=1e6 * num_missions / microseconds(learn, seconds),
        layer_us=microseconds(_inferring(lambda: layer(rows)), seconds / 2) / num_missions,
    )


def _own_decision_us(mission: Mission, shape: GnnShape, features: str, seconds: float) -> float:
    """One robot's network on its own graph [µs]."""
    network = FastAggregationGnn(shape)
    node, parent = (rows[:1] for rows in _tensors(_graphs(mission, features, 1)))
    return microseconds(_inferring(lambda: network(node, parent)), seconds / 2)


def _training_per_s(arm: str, mission: Mission, threads: int, seconds: float) -> float:
    """Team decisions over whole rollouts and the optimisation after each, the first left out."""
    settings = arm_settings(arm, mission, (mission.num_robots,))
    ppo, share = settings.ppo, settings.groups
    # One group of missions, and minibatches of about the arm's own size, so that it ends in time.
    fewer = replace(
        settings,
        threads=threads,
        missions=settings.missions // share,
        groups=1,
        ppo=replace(ppo, num_minibatches=max(1, ppo.num_minibatches // share)),
    )
    model, _ = make_model(fewer)
    clock = _Clock(seconds)
    model.learn(10**12, callback=clock, log_interval=10**9)
    return clock.num_rollouts * ppo.num_steps * fewer.missions / clock.elapsed_s


class _Clock(BaseCallback):
    """Ends the training at the first rollout that begins after some seconds."""

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self._seconds = seconds
        self._starts_s: list[float] = []

    @property
    def num_rollouts(self) -> int:
        """Timed ones."""
        return len(self._starts_s) - 2

    @property
    def elapsed_s(self) -> float:
        """From the second rollout's start to the last one's."""
        return self._starts_s[-1] - self._starts_s[1]

    def _on_rollout_start(self) -> None:
        self._starts_s.append(time.perf_counter())

    def _on_step(self) -> bool:
        return self.num_rollouts < 1 or self.elapsed_s < self._seconds


def _graphs(mission: Mission, features: str, num_missions: int) -> Graphs:
    """What teams see that have talked for a while."""
    swarm, policy = Swarm(mission, range(num_missions)), RoundRobin()
    extractor = make_extractor(features, mission)
    extractor.start(num_missions, mission.num_robots)
    graphs = extractor.graphs(swarm.views)
    for _ in range(WARM_UP_WINDOWS):
        swarm.step(policy)
        graphs = extractor.graphs(swarm.views)
    return graphs


def _tensors(graphs: Graphs) -> tuple[torch.Tensor, torch.Tensor]:
    parent: Int[np.ndarray, "R N"] = graphs.parent.astype(np.int64)
    return torch.from_numpy(graphs.node), torch.from_numpy(parent)


def _inferring(call: Callable[[], object]) -> Callable[[], None]:
    def infer() -> None:
        with torch.inference_mode():
            call()

    return infer
