"""How fast the simulation is: windows per second, whole and in parts, beside plain MuJoCo steps."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int
from mujoco._functions import mj_step
from mujoco._structs import MjData

from swarm_mj.costs import mean_hops, window_costs
from swarm_mj.mission import Mission, paper
from swarm_mj.policies import RoundRobin
from swarm_mj.protocol import window
from swarm_mj.scene import compose
from swarm_mj.swarm import Swarm

REPETITIONS = 7  # of each measurement; their median counts, for machines are shared
AUTHORS_WINDOWS_PER_S = 500.0  # the authors' environment, one mission on one core: 350 to 600


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


def bench(num_missions: int, *, num_threads: int = 1, seconds: float = 2.0) -> Timing:
    """Times random walks of 40 robots with round robin.

    Args:
        num_missions: B.
        num_threads: MuJoCo's own.
        seconds: About how long each measurement takes [s].

    Returns:
        The timing.
    """
    mission = paper("random-walk")
    swarm = Swarm(mission, range(num_missions), num_threads=num_threads)
    policy = RoundRobin()
    swarm.start(policy)
    recipient = swarm.decide(policy)
    phases = window(swarm.buffers, swarm.bodies, recipient, swarm.channel, swarm.now)
    parts = {
        "decide": lambda: swarm.decide(policy),
        "move": swarm.move,
        "radio and buffers": _talk(swarm, recipient),
        "costs": lambda: window_costs(
            swarm.buffers, swarm.bodies, phases, swarm.now, has_response=True
        ),
        "radio alone": lambda: swarm.channel(swarm.bodies.position_m, recipient),
        "hops (flights only)": lambda: mean_hops(swarm.buffers),
    }
    whole_us = _microseconds(lambda: swarm.step(policy), seconds)
    return Timing(
        num_missions=num_missions,
        windows_per_s=1e6 * num_missions / whole_us,
        mj_step_us=_microseconds(_plain_steps(mission), seconds / 4),
        parts_us={
            name: _microseconds(part, seconds / 4) / num_missions for name, part in parts.items()
        },
    )


def _talk(swarm: Swarm, recipient: Int[np.ndarray, "B N"]) -> Callable[[], object]:
    """A window of Alg. 1 on a clock that runs on, so that packets hold news."""
    now = swarm.now.copy()

    def talk() -> None:
        window(swarm.buffers, swarm.bodies, recipient, swarm.channel, now)
        now[:] += 1.0

    return talk


def _plain_steps(mission: Mission) -> Callable[[], None]:
    """One mj_step of the mission's scene."""
    model = compose(mission).compile()
    data = MjData(model)
    return lambda: mj_step(model, data)


def _microseconds(call: Callable[[], object], seconds: float) -> float:
    """Median time of a call [µs]."""
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
