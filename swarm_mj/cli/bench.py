"""`swarm-mj bench`: how fast the simulation and its parts are on this machine."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.table import Table

from swarm_mj.cli import bench_simulation as simulation
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
    tables, steps_us = [], []
    with Console(stderr=True).status("Measuring ...") as status:
        for title, head, columns in _measure(options, status.update):
            rows = [row for column in columns for row in column]
            steps_us += [row.value for row in rows if row.name == simulation.PLAIN_STEP]
            tables.append(_table(title, head, columns))
        steps_us.append(simulation.plain_step_us(options.seconds / 4))
    console = Console(highlight=False)
    for table in tables:
        console.print(table)
    plain_console().print(f"{LEGEND}\n{noise(steps_us)}")
    return 0


def noise(steps_us: Sequence[float]) -> str:
    """Return how far one number wanders that should always be the same."""
    least, most = min(steps_us), max(steps_us)
    spread = most / least - 1.0
    busy = "; the machine was busy, so measure again when it is not" if spread > BUSY else ""
    return (
        f"noise: the plain step was measured {len(steps_us)} times, from {least:.2f} to {most:.2f} "
        f"µs. Other numbers, too, may be off by {spread:.0%}{busy}."
    )


def _table(title: str, head: Sequence[str], columns: Sequence[Sequence[simulation.Row]]) -> Table:
    """Return a table; its columns have rows of the same names."""
    table = Table(title=title, title_justify="left", show_header=any(head))
    for index, name in enumerate(head):
        table.add_column(name, justify="right" if index else "left")
    for rows in zip(*columns, strict=True):
        values = (row.form.format(row.value) for row in rows)
        table.add_row(rows[0].name, *values, end_section=rows[0].ends_section)
    return table


def _measure(
    options: BenchOptions, say: Callable[[str], None]
) -> Iterator[tuple[str, Sequence[str], list[list[simulation.Row]]]]:
    """Yield each table's title, head and columns."""
    seconds, episodes, columns = options.seconds, options.episodes, []
    for num_missions in options.missions:
        say(f"Measuring with {num_missions} side by side ...")
        columns.append(list(simulation.simulation_rows(num_missions, options.threads, seconds)))
    head = ("missions side by side", *map(str, options.missions))
    yield "Simulation: 40 robots walk at random, policy round-robin", head, columns
    say("Measuring obstacles and fading ...")
    title = f"World: one window of one of {WORLD_MISSIONS} such missions"
    yield title, ("", ""), [list(simulation.world_rows(WORLD_MISSIONS, seconds))]
    if episodes:
        say(f"Measuring an evaluation of {episodes} missions ...")
        title = f"Evaluation: {episodes} random walks of 40 robots, 500 windows each"
        yield (title, ("", ""), [list(simulation.evaluation_rows(episodes, options.jobs, seconds))])
    if not options.no_learning:
        say("Measuring networks and training (a minute or two) ...")
        from swarm_mj.cli import bench_learning  # torch is slow to import

        rows = bench_learning.learning_rows(threads=options.threads, seconds=seconds)
        yield "Learning: 40 robots at rest", ("", ""), [list(rows)]
