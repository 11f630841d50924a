"""How fast the simulation is: windows per second, whole and in parts, beside plain MuJoCo steps.

And how long an evaluation takes, the oracle, and a robot that plans.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Int
from mujoco._functions import mj_step
from mujoco._structs import MjData

from swarm_mj.evaluation.batch import fly_batch
from swarm_mj.evaluation.jobs import run_jobs
from swarm_mj.evaluation.published import BASELINES
from swarm_mj.evaluation.study import Study
from swarm_mj.mission import Mission, paper
from swarm_mj.physics.scene import compose
from swarm_mj.policies.planner.plan import Plan
from swarm_mj.policies.planner.policy import regular_length
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.planner.snapshots import take_snapshots
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.round_robin import RoundRobin
from swarm_mj.protocol.costs import mean_hops, window_costs
from swarm_mj.protocol.window import window
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.swarm import Swarm

ORACLE_EPISODES = 4  # it takes its time
REPETITIONS = 7  # of each measurement; their median counts, for machines are shared
MISSION = paper("random-walk")
DENSE = replace(MISSION, range_ratio=1.0)
PLAN_SIZES = (40, 80, 200)  # robots


@dataclass(frozen=True, kw_only=True)
class Timing:
    """The speed of B missions side by side; times are per window of one mission."""

    num_missions: int
    windows_per_s: float  # the whole simulation
    mj_step_us: float  # a plain loop of mj_step over as many worlds, the yardstick of this run
    parts_us: dict[str, float]

    @property
    def in_mj_steps(self) -> float:
        """A whole window's time in plain mj_steps."""
        return 1e6 / self.windows_per_s / self.mj_step_us


@dataclass(frozen=True, kw_only=True)
class EvaluationTiming:
    """How long an evaluation takes: random walks of 40 robots, from empty buffers to the last."""

    episodes: int
    num_jobs: int
    baselines_s: float  # the paper's three baselines over all episodes, starting the jobs included
    oracle_s: float  # the oracle over one episode, one process
    plan_ms: Mapping[int, float]  # by team size: a robot's plan of one epoch, made at once
    dense_plan_ms: float  # of the first size, where everyone hears everyone
    mj_step_us: float  # the yardstick of this run, as above

    @property
    def window_in_mj_steps(self) -> float:
        """A window of the baselines on the wall clock, in plain mj_steps."""
        num_windows = len(BASELINES) * self.episodes * MISSION.num_windows
        return 1e6 * self.baselines_s / num_windows / self.mj_step_us


def bench(num_missions: int, *, num_threads: int = 1, seconds: float = 2.0) -> Timing:
    """Times random walks of 40 robots with round robin.

    Args:
        num_missions: B.
        num_threads: MuJoCo's own.
        seconds: About how long each measurement takes [s].

    Returns:
        The timing.
    """
    swarm = Swarm(MISSION, range(num_missions), num_threads=num_threads)
    policy = RoundRobin()
    swarm.start(policy)
    recipient = swarm.decide(policy)
    phases = window(swarm.buffers, swarm.states, recipient, swarm.channel, swarm.now)
    parts = {
        "decide": lambda: swarm.decide(policy),
        "move": swarm.move,
        "radio and buffers": _talk(swarm, recipient),
        "costs": lambda: window_costs(
            swarm.buffers, swarm.states, phases, swarm.now, is_broadcast=False
        ),
        "radio alone": lambda: swarm.channel(swarm.states.position_m, recipient),
        "hops (flights only)": lambda: mean_hops(swarm.buffers),
    }
    whole_us = microseconds(lambda: swarm.step(policy), seconds)
    return Timing(
        num_missions=num_missions,
        windows_per_s=1e6 * num_missions / whole_us,
        mj_step_us=microseconds(_plain_steps(MISSION), seconds / 4),
        parts_us={
            name: microseconds(part, seconds / 4) / num_missions for name, part in parts.items()
        },
    )


def bench_evaluation(episodes: int, *, num_jobs: int = 2, seconds: float = 2.0) -> EvaluationTiming:
    """Times an evaluation of the paper's baselines, and the oracle.

    Args:
        episodes: Missions of each baseline; the oracle flies at most `ORACLE_EPISODES`.
        num_jobs: Processes that share the baselines' missions.
        seconds: About how long the plain steps are measured, four times over [s].

    Returns:
        The timing.
    """
    for policy in (*BASELINES, "greedy-oracle"):  # compiles, if it never has
        _fly(Study(policies=(policy,), regimes=(replace(MISSION, num_windows=1),), episodes=1), 1)
    baselines = Study(policies=BASELINES, regimes=(MISSION,), episodes=episodes)
    num_oracles = min(episodes, ORACLE_EPISODES)
    oracle = Study(policies=("greedy-oracle",), regimes=(MISSION,), episodes=num_oracles)
    return EvaluationTiming(
        episodes=episodes,
        num_jobs=num_jobs,
        baselines_s=_fly(baselines, num_jobs),
        oracle_s=_fly(oracle, 1) / num_oracles,
        plan_ms={
            size: microseconds(_planning(replace(MISSION, num_robots=size)), seconds / 4) / 1000.0
            for size in PLAN_SIZES
        },
        dense_plan_ms=microseconds(_planning(DENSE), seconds / 4) / 1000.0,
        mj_step_us=microseconds(_plain_steps(MISSION), seconds / 4),
    )


def _fly(study: Study, num_jobs: int) -> float:
    """Wall time of a study's missions [s]."""
    start_s = time.perf_counter()
    for _ in run_jobs(fly_batch, study.batches, num_jobs):
        pass
    return time.perf_counter() - start_s


def _planning(mission: Mission) -> Callable[[], object]:
    """One robot's plan for an epoch, from what it knows after four rounds of TDMA."""
    swarm = Swarm(mission, [0])
    tdma = make_policy("tdma", mission)
    num_windows = regular_length(mission.num_robots, PlannerSettings().epochs)
    for _ in range(2 * mission.num_robots):
        swarm.step(tdma)
    buffers, now = swarm.buffers, float(swarm.now[0])
    radio, settings = radio_of(mission), PlannerSettings()

    def plan() -> object:
        snapshots = take_snapshots(
            buffers.position_m[0],
            buffers.velocity_mps[0],
            buffers.timestamp[0],
            buffers.is_known[0],
            now,
            mission.window_s,
            num_windows / 2.0,
            replace(settings.snapshots, fresh_rounds=10.0),
        )
        is_free = np.ones(2 * num_windows, dtype=bool)
        timestamp = buffers.timestamp[0]
        return Plan(radio, settings, snapshots, 0, timestamp, now, is_free).outcome()

    return plan


def _talk(swarm: Swarm, recipient: Int[np.ndarray, "B N"]) -> Callable[[], object]:
    """A window of Alg. 1 on a clock that runs on, so that packets hold news."""
    now = swarm.now.copy()

    def talk() -> None:
        window(swarm.buffers, swarm.states, recipient, swarm.channel, now)
        now[:] += 1.0

    return talk


def _plain_steps(mission: Mission) -> Callable[[], None]:
    """One mj_step of the mission's scene."""
    model = compose(mission).compile()
    data = MjData(model)
    return lambda: mj_step(model, data)


def microseconds(call: Callable[[], object], seconds: float) -> float:
    """Median time of a call [µs].

    Args:
        call: What is timed, after a call that is not.
        seconds: About how long the measurement takes [s].
    """
    call()
    start_s = time.perf_counter()
    call()
    once_s = time.perf_counter() - start_s
    num_calls = max(1, int(seconds / REPETITIONS / max(once_s, 1e-7)))
    times_s = []
    for _ in range(REPETITIONS):
        start_s = time.perf_counter()
        for _ in range(num_calls):
            call()
        times_s.append((time.perf_counter() - start_s) / num_calls)
    return 1e6 * float(np.median(times_s))
