"""How fast the simulation is: windows per second, whole and in parts, and what evaluations take.

The yardstick is a plain mj_step, timed in turn with what it is compared with. Times are those of
this thread on a processor, so that pauses for other programs do not count; only where several
threads work, and for evaluations, it is the time on the wall. A measurement takes about `seconds`.
"""

import json
import mmap
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from timeit import timeit
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int
from mujoco._functions import mj_step  # private: type checkers see it only there
from mujoco._structs import MjData

from swarm_mj.api.flight import compile_ahead, flight_needs
from swarm_mj.evaluation.batch import fly_batch
from swarm_mj.evaluation.engines import Local
from swarm_mj.evaluation.published import BASELINES
from swarm_mj.evaluation.study import Study
from swarm_mj.mission import Mission, paper
from swarm_mj.physics.scene import compose
from swarm_mj.policies.centralised import RoundRobin
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.costs import mean_hops, window_costs
from swarm_mj.protocol.window import channel_at
from swarm_mj.simulation.memory import FLYING
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.needs import check_fits, peak_memory
from swarm_mj.system.packages import commit, version
from swarm_mj.system.processes import attempt

ORACLE_EPISODES = 4  # at most: it takes its time
REPETITIONS = 7  # of each measurement; their median counts, for machines are shared
MISSION = paper("random-walk")
PLAIN_STEP = "one plain MuJoCo step of 40 robots"
IN_STEPS = "  in plain MuJoCo steps"
TEAMS_FLY = "random-flooding"  # a draw for each robot, so the simulation is what is measured
GROWING = ("window, ms", "team, MB")  # of teams; these are drawn
NUM_FITTED = 3  # of the largest teams: in small ones most of both does not grow
LONGEST_S = 1800.0  # of a team's process
MB = 1e6


Clock = Callable[[], float]  # [s]


class Row(NamedTuple):
    """A line of a table."""

    name: str
    value: float
    form: str = "{:.2f} µs"  # of the value, with its unit
    ends_section: bool = False


def simulation_rows(num_missions: int, num_threads: int, seconds: float) -> Iterator[Row]:
    """Time random walks of 40 robots with round robin, B side by side, per window of one mission.

    The threads are MuJoCo's own.
    """
    swarm = Swarm(MISSION, range(num_missions), num_threads=num_threads)
    policy = RoundRobin()
    swarm.start(policy)
    recipient = swarm.decide()
    swarm.step_with_recipients(recipient)
    request, response = swarm.phases
    channel = channel_at(swarm.channel, swarm.now)
    parts = {
        "  the policy decides": swarm.decide,
        "  MuJoCo moves the robots": swarm.move,
        "  the radio delivers, buffers merge": talking(swarm, recipient),
        "  costs are measured": lambda: window_costs(
            swarm.buffers, swarm.states, (request, response), swarm.now, is_broadcast=False
        ),
        "the radio alone": lambda: channel(swarm.states.position_m, recipient),
        "hops of news are counted (fly only)": lambda: mean_hops(swarm.buffers),
    }
    clock = clock_of(num_threads)
    many_us, step_us = in_turn_us((lambda: swarm.step(policy), plain_step()), seconds, clock)
    window_us = many_us / num_missions
    yield Row("windows simulated per second", 1e6 / window_us, "{:,.0f}")
    yield Row("time of one window of one mission", window_us)
    yield Row(IN_STEPS, window_us / step_us, "{:.2f}")
    yield Row(PLAIN_STEP, step_us, ends_section=True)
    for name, part in parts.items():
        yield Row(name, microseconds(part, seconds / 4, clock) / num_missions)


def world_rows(num_missions: int, seconds: float) -> Iterator[Row]:
    """Time the same walks where there is more than free space, per window of one mission.

    The two sides of a ratio are measured in turn, so that other load on the machine affects both.
    """

    def window_us(**world: Any) -> tuple[float, float]:
        """Return a window, and of it what MuJoCo takes."""
        swarm = Swarm(replace(MISSION, **world), range(num_missions))
        policy = RoundRobin()
        whole_us = microseconds(lambda: swarm.step(policy), seconds / 2)
        return whole_us / num_missions, microseconds(swarm.move, seconds / 4) / num_missions

    exact_us, _ = window_us()
    faded_us, _ = window_us(fading="rayleigh")
    yield Row("free space", exact_us)
    yield Row("Rayleigh fading", faded_us)
    yield Row("  times free space", faded_us / exact_us, "{:.2f}", ends_section=True)
    plain_us, plain_move_us = window_us(physics="contact")
    among_us, among_move_us = window_us(arena="blocks", physics="contact")
    yield Row("free space, contact physics", plain_us)
    yield Row("  of these, MuJoCo moves the robots", plain_move_us)
    yield Row("arena blocks, contact physics", among_us)
    yield Row("  of these, MuJoCo moves the robots", among_move_us)
    yield Row("  times none", among_us / plain_us, "{:.2f}")


def evaluation_rows(num_episodes: int, num_jobs: int, seconds: float) -> Iterator[Row]:
    """Time an evaluation of the paper's baselines, and of the oracle.

    The jobs share the baselines' missions. The time to start them is included.
    """
    for policy in (*BASELINES, "greedy-oracle"):  # compiles, if it never has
        _flying_s(policy, episodes=1, mission=replace(MISSION, num_windows=1))
    baselines_s = _flying_s(*BASELINES, episodes=num_episodes, jobs=num_jobs)
    step_us = plain_step_us(seconds / 4)
    window_us = 1e6 * baselines_s / (len(BASELINES) * num_episodes * MISSION.num_windows)
    yield Row(f"{', '.join(BASELINES)}, --jobs {num_jobs}", baselines_s, "{:.1f} s")
    yield Row("  one window of one mission, with start-up", window_us)
    yield Row(IN_STEPS, window_us / step_us, "{:.2f}")
    num_oracles = min(num_episodes, ORACLE_EPISODES)
    oracle_s = _flying_s("greedy-oracle", episodes=num_oracles)
    yield Row("greedy-oracle, one mission", oracle_s / num_oracles, "{:.2f} s")
    yield Row(PLAIN_STEP, step_us)


def _flying_s(*policies: str, episodes: int, jobs: int = 1, mission: Mission = MISSION) -> float:
    """Return the wall time of an evaluation's missions [s]."""
    study = Study(policies=policies, regimes=(mission,), episodes=episodes)
    start_s = time.perf_counter()
    list(Local(num_jobs=jobs).run(fly_batch, study.batches))
    return time.perf_counter() - start_s


def team_rows(num_robots: int, seconds: float) -> Iterator[Row]:
    """Measure a team in a process of its own, because peaks of memory would mix.

    Raise ValueError if it does not fit, or fails.
    """
    mission = replace(MISSION, num_robots=num_robots)
    needs = flight_needs(mission, TEAMS_FLY, is_recorded=False)
    check_fits(needs, None, "choose fewer --robots", is_forced=False, way_on="")
    program = f"from {__name__} import measure; measure({num_robots}, {seconds})"
    works, said = attempt(program, longest_s=LONGEST_S)
    if not works:
        raise ValueError(said)
    for name, value in json.loads(said).items():
        yield Row(name, value, "{:,.1f}" if value > 10.0 else "{:.3f}")
    yield Row("  estimated", (needs.memory - FLYING) / MB, "{:,.1f}")


def measure(num_robots: int, seconds: float) -> None:
    """Fly a team in this process, and print what it takes as JSON."""
    mission = replace(MISSION, num_robots=num_robots)
    compile_ahead(mission, TEAMS_FLY)
    policy = make_policy(TEAMS_FLY, mission)
    before = peak_memory()
    begun_s = time.thread_time()
    swarm = Swarm(mission, [0])
    start_s = time.thread_time() - begun_s
    window_us = microseconds(lambda: swarm.step(policy), seconds)
    peak = peak_memory()
    # A tiny team may fit in what the process has used already, so that the peak does not move. It
    # takes memory nevertheless, and the chart takes its logarithm: a page is the least of it.
    team = max(peak - before, mmap.PAGESIZE)
    values = {
        "start, s": start_s,
        "window, ms": window_us / 1e3,
        "process, MB": peak / MB,
        "team, MB": team / MB,
    }
    print(json.dumps(values))  # noqa: T201


def growth(teams: Mapping[str, Sequence[Row]], name: str) -> tuple[float, float]:
    """Return p and c of c N^p, the least squares in logarithms of a row over the largest teams."""
    numbers, values = np.log(_values(teams, name)[:, -NUM_FITTED:])
    power, constant = np.polyfit(numbers, values, 1)
    return float(power), float(np.exp(constant))


def _values(teams: Mapping[str, Sequence[Row]], name: str) -> Float[np.ndarray, "2 T"]:
    """Return the sizes of teams, and their values in a row."""
    numbers: list[int] = []
    values: list[float] = []
    for number, rows in teams.items():
        for row in rows:
            if row.name == name:
                numbers.append(int(number))
                values.append(row.value)
    return np.array([numbers, values], dtype=np.float64)


def draw_teams(teams: Mapping[str, Sequence[Row]], path: Path) -> None:
    """Write a chart of what grows with the team, and of the fits."""
    from matplotlib.figure import Figure  # slow to import

    from swarm_mj.evaluation.figures.style import code, look_of, save, styled, write_caption

    look = look_of(TEAMS_FLY)
    with styled():
        figure = Figure(figsize=(7.5, 3.0), layout="constrained")
        for axes, name in zip(figure.subplots(1, 2), GROWING, strict=True):
            numbers, values = _values(teams, name)
            power, factor = growth(teams, name)
            fitted = numbers[-NUM_FITTED:]
            axes.loglog(fitted, factor * fitted**power, color=look.colour)
            axes.loglog(numbers, values, look.marker, color=look.colour)
            axes.set(xlabel="robots", title=f"{name}: grows with $N^{{{power:.2f}}}$")
        said = f"random walk, {look.label}; lines: fits of the {NUM_FITTED} largest teams"
        write_caption(figure, f"{said}; {code(version(), commit())}")
    save(figure, path)


def talking(swarm: Swarm, recipient: Int[np.ndarray, "B N"]) -> Callable[[], object]:
    """Return what repeats the radio's part of a window, on the swarm's own clock.

    The clock must run on: packets would hold nothing new otherwise. It must also be the swarm's,
    because a buffer that holds entries from the future takes none that is older, so that parents
    of different windows mix and no longer lead back to the buffer's owner.
    """

    def talk() -> None:
        swarm.talk.window(
            swarm.buffers,
            lambda _: recipient,
            lambda: swarm.states,
            now=swarm.now,
            silence_is_attempt=False,
        )
        swarm.now = swarm.now + 1.0

    return talk


def plain_step() -> Callable[[], None]:
    """Return an mj_step of the scene of 40 robots."""
    model = compose(MISSION).compile()
    data = MjData(model)
    return lambda: mj_step(model, data)


def plain_step_us(seconds: float) -> float:
    """Time a plain step [µs]."""
    return microseconds(plain_step(), seconds)


def clock_of(num_threads: int) -> Clock:
    """Return the clock of work on this many threads: of several, only the wall's counts all."""
    return time.thread_time if num_threads == 1 else time.perf_counter


def microseconds(
    call: Callable[[], object], seconds: float, clock: Clock = time.thread_time
) -> float:
    """Return the median time of a call, after one that is not timed [µs]."""
    (call_us,) = in_turn_us((call,), seconds, clock)
    return call_us


def in_turn_us(
    calls: Sequence[Callable[[], object]], seconds: float, clock: Clock = time.thread_time
) -> list[float]:
    """Return the median times of calls that are timed in turn, so that load affects all [µs]."""
    numbers = []
    for call in calls:
        call()
        once_s = max(timeit(call, number=1, timer=clock), 1e-7)
        numbers.append(max(1, int(seconds / REPETITIONS / len(calls) / once_s)))
    times_us: list[list[float]] = [[] for _ in calls]
    for _ in range(REPETITIONS):
        for call, number, its_us in zip(calls, numbers, times_us, strict=True):
            its_us.append(1e6 * timeit(call, number=number, timer=clock) / number)
    return [float(np.median(its_us)) for its_us in times_us]
