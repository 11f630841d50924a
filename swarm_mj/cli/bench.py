"""`swarm-mj bench`: how fast the simulation and evaluations are on this machine."""

import argparse
from typing import Any

from rich.console import Console
from rich.table import Table

from swarm_mj.bench import AUTHORS_WINDOWS_PER_S, EvaluationTiming, Timing, bench, bench_evaluation
from swarm_mj.cli.options import new_parser
from swarm_mj.published import BASELINES

LIMITS = {"missions": (1, 10_000), "threads": (1, 256), "episodes": (0, 10_000), "jobs": (1, 256)}


def add_parser(commands: Any) -> None:  # noqa: ANN401 - argparse names no public type
    """Adds the command."""
    parser = new_parser(
        commands,
        "bench",
        "Time the simulation: random walks of 40 robots with round robin, and an evaluation.",
    )
    parser.add_argument(
        "--missions",
        type=int,
        nargs="+",
        default=[1, 32, 256],
        help="how many missions stand side by side",
    )
    parser.add_argument("--threads", type=int, default=1, help="of MuJoCo")
    parser.add_argument("--seconds", type=float, default=2.0, help="per measurement, about")
    parser.add_argument(
        "--episodes",
        type=int,
        default=100,
        help="of each baseline in the evaluation that is timed; 0 leaves it out",
    )
    parser.add_argument("--jobs", type=int, default=2, help="processes of that evaluation")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Runs the command; returns its exit code."""
    for name, (low, high) in LIMITS.items():
        given = getattr(options, name)
        for value in given if isinstance(given, list) else [given]:
            if not low <= value <= high:
                raise ValueError(f"{name} must be from {low} to {high}, not {value}")
    if not 0.1 <= options.seconds <= 600.0:
        raise ValueError(f"seconds must be from 0.1 to 600, not {options.seconds:g}")
    timings, evaluation = [], None
    with Console(stderr=True).status("Measuring ...") as status:
        for num_missions in options.missions:
            status.update(f"Measuring {num_missions} missions side by side ...")
            timing = bench(num_missions, num_threads=options.threads, seconds=options.seconds)
            timings.append(timing)
        if options.episodes:
            status.update(f"Measuring an evaluation of {options.episodes} missions ...")
            evaluation = bench_evaluation(
                options.episodes, num_jobs=options.jobs, seconds=options.seconds
            )
    console = Console(highlight=False)
    console.print(_table(timings))
    if evaluation:
        console.print(_evaluation_table(evaluation))
    return 0


def _table(timings: list[Timing]) -> Table:
    table = Table(title="Random walk of 40 robots, round robin", title_justify="left")
    table.add_column("missions side by side")
    for timing in timings:
        table.add_column(f"{timing.num_missions}", justify="right")
    table.add_row("windows per second", *(f"{t.windows_per_s:,.0f}" for t in timings))
    table.add_row(
        f"  of the authors' {AUTHORS_WINDOWS_PER_S:.0f}",
        *(f"{t.windows_per_s / AUTHORS_WINDOWS_PER_S:.1f} x" for t in timings),
    )
    table.add_row("one window, µs", *(f"{1e6 / t.windows_per_s:.2f}" for t in timings))
    table.add_row("  in plain mj_steps", *(f"{t.in_mj_steps:.2f} x" for t in timings))
    table.add_row("plain mj_step, µs", *(f"{t.mj_step_us:.2f}" for t in timings), end_section=True)
    for part in timings[0].parts_us:
        table.add_row(f"{part}, µs", *(f"{t.parts_us[part]:.2f}" for t in timings))
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
    table.add_row("oracle, one episode, s", f"{timing.oracle_s:.2f}")
    table.add_row("planner, one robot's plan of an epoch, ms", f"{timing.plan_ms:.1f}")
    table.add_row("  at range ratio 1, ms", f"{timing.dense_plan_ms:.1f}")
    table.add_row("plain mj_step, µs", f"{timing.mj_step_us:.2f}")
    return table
