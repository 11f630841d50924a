"""`swarm-mj bench`: how fast the simulation and evaluations are on this machine."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from swarm_mj.benchmark.simulation import (
    EvaluationTiming,
    Timing,
    bench,
    bench_evaluation,
)
from swarm_mj.evaluation.published import BASELINES
from swarm_mj.fields import setting
from swarm_mj.policies.planner.policy import regular_length
from swarm_mj.policies.planner.settings import PlannerSettings

if TYPE_CHECKING:
    from swarm_mj.benchmark.learning import LearningTiming


@dataclass(frozen=True, kw_only=True)
class Options:
    """The options of `swarm-mj bench`."""

    missions: tuple[int, ...] = setting((1, 32, 256), "missions side by side", low=1, high=10_000)
    threads: int = setting(1, "threads of MuJoCo and torch", low=1, high=256)
    seconds: float = setting(2.0, "a measurement's time, about", unit="s", low=0.1, high=600.0)
    episodes: int = setting(
        100,
        "missions of each baseline in the evaluation that is timed; 0 leaves it out",
        low=0,
        high=10_000,
    )
    jobs: int = setting(2, "processes of that evaluation", low=1, high=256)
    no_learning: bool = setting(False, "leave out the networks and the training")


def run(options: Options) -> int:
    """Runs the command; returns its exit code."""
    with Console(stderr=True).status("Measuring ...") as status:
        tables = list(_measure(options, status.update))
    console = Console(highlight=False)
    for table in tables:
        console.print(table)
    return 0


def _measure(options: Options, say: Callable[[str], None]) -> Iterator[Table]:
    timings = []
    for num_missions in options.missions:
        say(f"Measuring {num_missions} missions side by side ...")
        timings.append(bench(num_missions, num_threads=options.threads, seconds=options.seconds))
    yield _table(timings)
    if options.episodes:
        say(f"Measuring an evaluation of {options.episodes} missions ...")
        yield _evaluation_table(
            bench_evaluation(options.episodes, num_jobs=options.jobs, seconds=options.seconds)
        )
    if not options.no_learning:
        say("Measuring networks and training (a minute or two) ...")
        from swarm_mj.benchmark.learning import bench_learning  # torch takes its time to import

        yield _learning_table(bench_learning(threads=options.threads, seconds=options.seconds))


def _table(timings: list[Timing]) -> Table:
    table = Table(title="Random walk of 40 robots, round robin", title_justify="left")
    table.add_column("missions side by side")
    for timing in timings:
        table.add_column(f"{timing.num_missions}", justify="right")
    table.add_row("windows per second", *(f"{t.windows_per_s:,.0f}" for t in timings))
    table.add_row("one window, µs", *(f"{1e6 / t.windows_per_s:.2f}" for t in timings))
    table.add_row("  in plain mj_steps", *(f"{t.in_mj_steps:.2f} x" for t in timings))
    table.add_row("plain mj_step, µs", *(f"{t.mj_step_us:.2f}" for t in timings), end_section=True)
    for part in timings[0].parts_us:
        table.add_row(f"{part}, µs", *(f"{t.parts_us[part]:.2f}" for t in timings))
    return table


def _learning_table(timing: "LearningTiming") -> Table:
    table = Table(
        title="Learning: 40 stationary robots, team decisions per second",
        title_justify="left",
        show_header=False,
    )
    table.add_column()
    table.add_column(justify="right")
    for each in timing.networks:
        missions = f"{each.num_missions} mission{'s' if each.num_missions > 1 else ''}"
        table.add_row(f"the paper's network, {missions}, forward", f"{each.forward_per_s:.0f}")
        table.add_row("  in 64 x 64 layers over as many nodes", f"{each.forward_in_layers:.1f} x")
        table.add_row("  forward and backward", f"{each.backward_per_s:.0f}")
    for arm, per_s in timing.training_per_s.items():
        table.add_row(f"training, arm {arm}", f"{per_s:.1f}")
    for name, decision_us in timing.own_decision_us.items():
        table.add_row(f"one robot's decision, {name} network, µs", f"{decision_us:.0f}")
    return table


def _evaluation_table(timing: EvaluationTiming) -> Table:
    table = Table(
        title=f"Evaluation: {timing.episodes} random walks of 40 robots",
        title_justify="left",
        show_header=False,
    )
    table.add_column()
    table.add_column(justify="right")
    table.add_row(f"{', '.join(BASELINES)}; {timing.num_jobs} jobs, s", f"{timing.baselines_s:.1f}")
    table.add_row("  one window, in plain mj_steps", f"{timing.window_in_mj_steps:.2f} x")
    table.add_row("greedy-oracle, one episode, s", f"{timing.oracle_s:.2f}")
    for size, plan_ms in timing.plan_ms.items():
        table.add_row(f"planner, one robot's plan of an epoch, {size} robots, ms", f"{plan_ms:.1f}")
        each_ms = plan_ms / (2 * regular_length(size, PlannerSettings().epochs))
        table.add_row("  for each half window, ms", f"{each_ms:.2f}")
    table.add_row("  of 40 robots at range ratio 1, ms", f"{timing.dense_plan_ms:.1f}")
    table.add_row("plain mj_step, µs", f"{timing.mj_step_us:.2f}")
    return table
