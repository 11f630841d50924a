"""How fast the paper's network decides, on its own and for a team, and how fast it trains."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import torch

from swarm_mj.cli.bench_simulation import Clock, Row, clock_of, in_turn_us, microseconds
from swarm_mj.envs.gymnasium_vector import SwarmVectorEnv
from swarm_mj.learning.ppo import make_model
from swarm_mj.learning.settings import usual_settings
from swarm_mj.learning.ways import CreditAssignment
from swarm_mj.mission import Mission, paper
from swarm_mj.policies.centralised import RoundRobin
from swarm_mj.policies.gnn.fast import FastAggregationGnn
from swarm_mj.policies.gnn.feature_sets import make_extractor
from swarm_mj.policies.gnn.graphs import PaperFeatures
from swarm_mj.policies.policy_config import GnnShape
from swarm_mj.simulation.swarm import Swarm

WARM_UP_WINDOWS = 100  # after which most robots know most others
SHAPE = GnnShape(num_features=len(PaperFeatures.names))  # the paper's


def learning_rows(*, num_robots: int = 40, threads: int = 1, seconds: float = 2.0) -> Iterator[Row]:
    """Time networks and training, in team decisions per second; no weights are kept."""
    torch.set_num_threads(threads)
    clock = clock_of(threads)
    mission = paper("stationary", num_robots=num_robots)
    for num_missions in (1, 32):
        yield from _network_rows(mission, num_missions, seconds, clock)
    for features in ("turns", "extended"):
        ratio = _features_windows(features, mission, 32, seconds)
        yield Row(f"{features} features, 32 missions, in windows", ratio, "{:.2f}")
    ratio = _environment_windows(mission, 32, seconds)
    yield Row("a step of make_vec, 32 missions, default features, in windows", ratio, "{:.2f}")
    for credit in ("robot", "team"):
        per_s = _training_per_s(credit, mission, threads, seconds)
        yield Row(f"train --credit {credit}: team decisions", per_s, "{:.1f} / s")
    robot = usual_settings("robot", mission, (num_robots,))
    own = {"--credit robot": (robot.network, robot.features), "the paper": (SHAPE, "paper")}
    for name, (shape, features) in own.items():
        node, parent = _graphs(mission, features, 1)
        decide = _forward(FastAggregationGnn(shape), node[:1], parent[:1])
        decision_us = microseconds(decide, seconds / 2, clock)
        yield Row(f"one robot's decision, network of {name}", decision_us, "{:.0f} µs")


def _features_windows(features: str, mission: Mission, num_missions: int, seconds: float) -> float:
    """Return the time of features over that of a window of the missions that they are made of."""
    swarm = Swarm(mission, range(num_missions))
    seen = Swarm(mission, range(num_missions))
    swarm.start(RoundRobin())
    seen.start(RoundRobin())
    extractor = make_extractor(features, mission)
    extractor.start(num_missions, mission.num_robots)

    def step_and_see() -> None:
        seen.step()
        extractor.graphs(seen.views)

    window_us, both_us = in_turn_us((swarm.step, step_and_see), seconds)
    return both_us / window_us - 1.0


def _environment_windows(mission: Mission, num_missions: int, seconds: float) -> float:
    """Return a step of the environment over a window of its missions that a `Swarm` flies alone."""
    swarm = Swarm(mission, range(num_missions))
    env = SwarmVectorEnv(num_missions, mission)
    swarm.start(RoundRobin())
    env.reset(seed=list(range(num_missions)))
    window_us, both_us = in_turn_us(
        (swarm.step, lambda: (swarm.step(), env.step(swarm.phases[0].recipient))), 1.5 * seconds
    )
    return both_us / window_us - 1.0


def _network_rows(
    mission: Mission, num_missions: int, seconds: float, clock: Clock
) -> Iterator[Row]:
    """Time the paper's network (K = 5, width 64) on the CPU."""
    network = FastAggregationGnn(SHAPE)
    node, parent = _graphs(mission, "paper", num_missions)
    forward_us = microseconds(_forward(network, node, parent), seconds, clock)
    backward_us = microseconds(lambda: network(node, parent).sum().backward(), seconds, clock)
    whose = f"the paper's network, {num_missions} mission{'s' if num_missions > 1 else ''}"
    yield Row(f"{whose}: team decisions", 1e6 * num_missions / forward_us, "{:.0f} / s")
    yield Row("  with gradients, as in training", 1e6 * num_missions / backward_us, "{:.0f} / s")


def _forward(network: torch.nn.Module, *inputs: torch.Tensor) -> Callable[[], object]:
    return torch.inference_mode()(lambda: network(*inputs))


def _training_per_s(
    credit: CreditAssignment, mission: Mission, threads: int, seconds: float
) -> float:
    """Return the team decisions per second of rollouts and the optimisation after each."""
    settings = usual_settings(credit, mission, (mission.num_robots,))
    ppo = settings.ppo
    share = settings.groups
    # One group of missions, and minibatches of about the usual size, so that it ends in time.
    ppo = replace(ppo, num_minibatches=max(1, ppo.num_minibatches // share))
    missions = settings.missions // share
    fewer = replace(settings, threads=threads, missions=missions, groups=1, ppo=ppo)
    learn = partial(make_model(fewer).learn, 1, reset_num_timesteps=False, log_interval=10**9)
    learn_us = microseconds(learn, seconds, clock_of(threads))
    return 1e6 * ppo.num_steps * missions / learn_us


def _graphs(mission: Mission, features: str, number: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the features and parents of all robots' nodes after a warm-up."""
    swarm = Swarm(mission, range(number))
    policy = RoundRobin()
    extractor = make_extractor(features, mission)
    extractor.start(number, mission.num_robots)
    for _ in range(WARM_UP_WINDOWS):
        extractor.graphs(swarm.views)
        swarm.step(policy)
    graphs = extractor.graphs(swarm.views)
    return torch.from_numpy(graphs.node), torch.from_numpy(graphs.parent.astype(np.int64))
