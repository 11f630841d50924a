"""How fast the paper's network decides, on its own and for a team, and how fast it trains."""

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback

from swarm_mj.cli.benchmark.simulation import Row, microseconds
from swarm_mj.learning.ppo import make_model
from swarm_mj.learning.settings import usual_settings
from swarm_mj.mission import Mission, paper
from swarm_mj.policies.centralised import RoundRobin
from swarm_mj.policies.gnn.fast import FastAggregationGnn
from swarm_mj.policies.gnn.feature_sets import make_extractor
from swarm_mj.policies.gnn.graphs import PaperFeatures
from swarm_mj.policies.policy_config import GnnShape
from swarm_mj.simulation.swarm import Swarm

NUM_ROBOTS = 40
WARM_UP_WINDOWS = 100  # after which most robots know most others
SHAPE = GnnShape(num_features=len(PaperFeatures.names))  # the paper's


def learning_rows(
    *, num_robots: int = NUM_ROBOTS, threads: int = 1, seconds: float = 2.0
) -> Iterator[Row]:
    """Time networks and training, in team decisions per second; no weights are kept.

    The threads are torch's; each measurement takes about so many seconds.
    """
    torch.set_num_threads(threads)
    mission = paper("stationary", num_robots=num_robots)
    for num_missions in (1, 32):
        yield from _network_rows(mission, num_missions, seconds)
    for credit in ("robot", "team"):
        per_s = _training_per_s(credit, mission, threads, seconds)
        yield Row(f"train --credit {credit}: team decisions", per_s, "{:.1f} / s")
    robot = usual_settings("robot", mission, (num_robots,))
    own = {"--credit robot": (robot.network, robot.features), "the paper": (SHAPE, "paper")}
    for name, (shape, features) in own.items():
        node, parent = (rows[:1] for rows in _graphs(mission, features, 1))
        decision_us = _forward_us(FastAggregationGnn(shape), node, parent, seconds=seconds / 2)
        yield Row(f"one robot's decision, network of {name}", decision_us, "{:.0f} µs")


def _network_rows(mission: Mission, num_missions: int, seconds: float) -> Iterator[Row]:
    """Return the paper's network (K = 5, width 64) on the CPU.

    The yardstick is a plain product of the same numbers: as many rows as the network has nodes,
    through one 64 by 64 layer, in the same run.
    """
    network = FastAggregationGnn(SHAPE)
    node, parent = _graphs(mission, "paper", num_missions)
    layer = torch.nn.Linear(SHAPE.latent, SHAPE.latent)
    rows = torch.randn(node.shape[0] * node.shape[1], SHAPE.latent)

    def learn() -> None:
        network(node, parent).sum().backward()

    forward_us = _forward_us(network, node, parent, seconds=seconds)
    backward_us = microseconds(learn, seconds)
    layer_us = _forward_us(layer, rows, seconds=seconds / 2)
    missions = f"{num_missions} mission{'s' if num_missions > 1 else ''}"
    whose = f"the paper's network, {missions}"
    forward_per_s, backward_per_s = (1e6 * num_missions / us for us in (forward_us, backward_us))
    yield Row(f"{whose}: team decisions", forward_per_s, "{:.0f} / s")
    yield Row("  one takes as long as so many 64 x 64 layers", forward_us / layer_us, "{:.1f}")
    yield Row("  with gradients, as in training", backward_per_s, "{:.0f} / s")


def _forward_us(network: torch.nn.Module, *inputs: torch.Tensor, seconds: float) -> float:
    """Time a forward pass without gradients [µs]."""
    return microseconds(torch.inference_mode()(lambda: network(*inputs)), seconds)


def _training_per_s(credit: str, mission: Mission, threads: int, seconds: float) -> float:
    """Team decisions over whole rollouts and the optimisation after each, the first left out."""
    settings = usual_settings(credit, mission, (mission.num_robots,))
    ppo, share = settings.ppo, settings.groups
    # One group of missions, and minibatches of about the usual size, so that it ends in time.
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
    num_rollouts = len(clock.starts_s) - 2
    return num_rollouts * ppo.num_steps * fewer.missions / clock.elapsed_s


class _Clock(BaseCallback):
    """Ends the training at the first rollout that begins after some seconds."""

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self._seconds = seconds
        self.starts_s: list[float] = []  # of rollouts

    @property
    def elapsed_s(self) -> float:
        """Over whole rollouts but the first."""
        return self.starts_s[-1] - self.starts_s[1] if len(self.starts_s) > 1 else 0.0

    def _on_rollout_start(self) -> None:
        self.starts_s.append(time.perf_counter())

    def _on_step(self) -> bool:
        return self.elapsed_s < self._seconds


def _graphs(mission: Mission, features: str, num_missions: int) -> tuple[torch.Tensor, ...]:
    """Return the features and parents of all robots' nodes after a warm-up."""
    swarm, policy = Swarm(mission, range(num_missions)), RoundRobin()
    extractor = make_extractor(features, mission)
    extractor.start(num_missions, mission.num_robots)
    for _ in range(WARM_UP_WINDOWS):
        extractor.graphs(swarm.views)
        swarm.step(policy)
    graphs = extractor.graphs(swarm.views)
    return torch.from_numpy(graphs.node), torch.from_numpy(graphs.parent.astype(np.int64))
