"""`swarm-mj bench`: how fast the simulation and evaluations are on this machine."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.table import Table

from swarm_mj.benchmark.simulation import Row, evaluation_rows, simulation_rows
from swarm_mj.cli.terminal import tell_cores
from swarm_mj.fields import setting


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
    tell_cores(options.jobs if options.episodes else 1)
    tell_cores(options.threads, "threads")
    with Console(stderr=True).status("Measuring ...") as status:
        tables = list(_measure(options, status.update))
    console = Console(highlight=False)
    for table in tables:
        console.print(table)
    return 0


def _measure(options: Options, say: Callable[[str], None]) -> Iterator[Table]:
    columns = []
    for num_missions in options.missions:
        say(f"Measuring with {num_missions} side by side ...")
        rows = simulation_rows(num_missions, num_threads=options.threads, seconds=options.seconds)
        columns.append(list(rows))
    head = ("missions side by side", *map(str, options.missions))
    yield _table("Random walk of 40 robots, round robin", *columns, head=head)
    if options.episodes:
        say(f"Measuring an evaluation of {options.episodes} missions ...")
        rows = evaluation_rows(options.episodes, num_jobs=options.jobs, seconds=options.seconds)
        yield _table(f"Evaluation: {options.episodes} random walks of 40 robots", rows)
    if not options.no_learning:
        say("Measuring networks and training (a minute or two) ...")
        from swarm_mj.benchmark import learning  # torch takes its time to import

        rows = learning.learning_rows(threads=options.threads, seconds=options.seconds)
        yield _table("Learning: 40 stationary robots, team decisions per second", rows)


def _table(title: str, *columns: Iterable[Row], head: Sequence[str] = ("", "")) -> Table:
    """Rows of the same names, each with a value from every column."""
    table = Table(title=title, title_justify="left", show_header=any(head))
    for index, name in enumerate(head):
        table.add_column(name, justify="right" if index else "left")
    for rows in zip(*columns, strict=True):
        values = (row.form.format(row.value) for row in rows)
        table.add_row(rows[0].name, *values, end_section=rows[0].ends_section)
    return table
