"""`swarm-mj bench`: how fast the simulation and evaluations are on this machine."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

from swarm_mj.cli.benchmark.simulation import (
    PLAIN_STEP,
    Row,
    evaluation_rows,
    plain_step_us,
    simulation_rows,
    world_rows,
)
from swarm_mj.system.fields import setting
from swarm_mj.system.terminal import plain_console, tell_cores

WORLD_MISSIONS = 32  # side by side, among obstacles and under fading
BUSY = 0.3  # the spread from which on numbers say little
LEGEND = """\
window: 100 ms of a mission. The indented rows below the line are its parts.
plain MuJoCo step: mj_step of the same scene, without radio: the yardstick.
obstacles: they cost most in MuJoCo, which looks for contacts in each of its ten steps a window.
plan: what the planner's robots compute once in an epoch of half as many windows as robots.
team decision: the network decides for all robots of a team, in one window."""


@dataclass(frozen=True, kw_only=True)
class BenchOptions:
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


def run(options: BenchOptions) -> int:
    """Run the command; return its exit code."""
    tell_cores(options.jobs if options.episodes else 1)
    tell_cores(options.threads, "threads")
    with Console(stderr=True).status("Measuring ...") as status:
        tables = list(_measure(options, status.update))
        steps_us = [row.value for each in tables for row in each.rows if row.name == PLAIN_STEP]
        steps_us.append(plain_step_us(options.seconds / 4))
    console = Console(highlight=False)
    for each in tables:
        console.print(each.drawn())
    plain_console().print(f"{LEGEND}\n{noise(steps_us)}")
    return 0


def noise(steps_us: Sequence[float]) -> str:
    """How far one number wanders that should always be the same."""
    least, most = min(steps_us), max(steps_us)
    spread = most / least - 1.0
    busy = "; the machine was busy, so measure again when it is not" if spread > BUSY else ""
    return (
        f"noise: the plain step was measured {len(steps_us)} times, from {least:.2f} to {most:.2f} "
        f"µs. Other numbers, too, may be off by {spread:.0%}{busy}."
    )


class _Measured(NamedTuple):
    """A table: rows of the same names, each with a value from every column."""

    title: str
    columns: Sequence[Sequence[Row]]
    head: Sequence[str] = ("", "")

    @property
    def rows(self) -> Iterator[Row]:
        return (row for column in self.columns for row in column)

    def drawn(self) -> Table:
        table = Table(title=self.title, title_justify="left", show_header=any(self.head))
        for index, name in enumerate(self.head):
            table.add_column(name, justify="right" if index else "left")
        for rows in zip(*self.columns, strict=True):
            values = (row.form.format(row.value) for row in rows)
            table.add_row(rows[0].name, *values, end_section=rows[0].ends_section)
        return table


def _measure(options: BenchOptions, say: Callable[[str], None]) -> Iterator[_Measured]:
    columns = []
    for num_missions in options.missions:
        say(f"Measuring with {num_missions} side by side ...")
        rows = simulation_rows(num_missions, num_threads=options.threads, seconds=options.seconds)
        columns.append(list(rows))
    head = ("missions side by side", *map(str, options.missions))
    yield _Measured("Simulation: 40 robots walk at random, policy round-robin", columns, head)
    say("Measuring obstacles and fading ...")
    rows = world_rows(WORLD_MISSIONS, seconds=options.seconds)
    yield _Measured(f"World: one window of one of {WORLD_MISSIONS} such missions", [list(rows)])
    if options.episodes:
        say(f"Measuring an evaluation of {options.episodes} missions ...")
        rows = evaluation_rows(options.episodes, num_jobs=options.jobs, seconds=options.seconds)
        title = f"Evaluation: {options.episodes} random walks of 40 robots, 500 windows each"
        yield _Measured(title, [list(rows)])
    if not options.no_learning:
        say("Measuring networks and training (a minute or two) ...")
        from swarm_mj.cli.benchmark import learning  # torch takes its time to import

        rows = learning.learning_rows(threads=options.threads, seconds=options.seconds)
        yield _Measured("Learning: 40 robots at rest", [list(rows)])
