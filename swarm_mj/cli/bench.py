"""`swarm-mj bench`: how fast the simulation and its parts are on this machine."""

import platform
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console
from rich.table import Table

from swarm_mj.cli import bench_bodies, bench_decisions
from swarm_mj.cli import bench_simulation as sim
from swarm_mj.cli.options import output_option
from swarm_mj.policies.registry import POLICIES, SHIPPED
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import setting
from swarm_mj.system.interrupt import raise_if_interrupted
from swarm_mj.system.packages import commit, is_installed, need, version
from swarm_mj.system.terminal import num_cores, plain_console, say_written, tell_cores
from swarm_mj.system.writing import Output, check_outputs, write_json

WORLD_MISSIONS = 32  # side by side, among obstacles and under fading
BODY_MISSIONS = (8, 32)  # side by side, of robots with bodies
BUSY = 0.3  # the spread from which on numbers say little
LEGEND = """
window: 100 ms of a mission. The indented rows below the line are its parts.
plain MuJoCo step: mj_step of the same scene, without radio: the yardstick, timed in turn with ours.
times: of one thread on a processor; of several threads, and of evaluations, on the wall.
arena blocks: costs most in MuJoCo, which looks for contacts in each of its ten steps a window.
time to decide: processor time of one thread, which decides for all robots, in the mean of the first
120 windows of a mission. The planner's includes its plans, once in half as many windows as there
are robots. Where robots walk, planner --payload none flies as spatial-tdma.
quadrotors: MuJoCo takes 20 steps a window for them, and their pilot steers in each.
team decision: the network decides for all robots of a team, in one window.
process: its largest memory. team: its memory beyond that of a team of three robots, and below it
what `fly` estimates."""


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
    robots: tuple[int, ...] = setting(
        (), "measure teams of these sizes instead", low=2, high=10_000, shown="none"
    )
    json: Path | None = output_option(
        None,
        "write what is printed, with unrounded values, and the processor's model",
        metavar="FILE.json",
    )
    plot: Path | None = output_option(None, "draw these teams", metavar="FILE.png|.svg|.pdf")
    force: bool = output_option(False, "replace existing files")


class Measured(NamedTuple):
    """A table: columns with rows of the same names, which `head` stands above."""

    title: str
    columns: Mapping[str, Sequence[sim.Row]]
    head: str = ""


def run(options: BenchOptions) -> int:
    """Run the command; return its exit code."""
    if options.plot:
        need("matplotlib", "a chart")
    chart = Output("--plot", options.plot, ".png|.svg|.pdf")
    check_outputs(Output("--json", options.json, ".json"), chart, must_be_new=not options.force)
    if options.plot or options.robots:
        _check_teams(set(options.robots))
    tell_cores(options.jobs if options.episodes else 1)
    tell_cores(options.threads, "threads")
    tables = []
    steps_us = [sim.plain_step_us(options.seconds / 4)]
    with Console(stderr=True).status("Measuring ...") as status:
        tables_of = _team_tables if options.robots or options.plot else _tables
        for table in tables_of(options, status.update):
            raise_if_interrupted()  # what a table loaded may have swallowed it
            tables.append(table)
            steps_us.append(sim.plain_step_us(options.seconds / 4))
    Console(highlight=False).print(*map(_table, tables), sep="\n")
    plain_console().print(f"{LEGEND}\n{noise(steps_us)}")
    if options.json:
        write_json(options.json, document(options, tables, steps_us))
        say_written(options.json)
    if options.plot:
        say_written(options.plot)
    return DONE


def noise(steps_us: Sequence[float]) -> str:
    """Return the spread of a measurement that should always be the same."""
    least = min(steps_us)
    most = max(steps_us)
    spread = most / least - 1.0
    busy = "; the machine was busy, so measure again when it is not" if spread > BUSY else ""
    measured = f"measured {len(steps_us)} times, from {least:.2f} to {most:.2f} µs"
    others = f"Other numbers, too, may be off by {spread:.0%}{busy}."
    return f"noise: the plain step was {measured}. {others}"


def document(
    options: BenchOptions, tables: Sequence[Measured], steps_us: Sequence[float]
) -> dict[str, Any]:
    """Return what is printed, as `--json` has it; a row has one value for each column."""
    spread = max(steps_us) / min(steps_us) - 1.0
    about = {"version": version(), "commit": commit(), "cpu": _cpu(), "cores": num_cores()}
    about |= {"threads": options.threads, "seconds": options.seconds}
    about["noise"] = {"plain_step_us": steps_us, "spread": spread}
    return about | {"tables": [_entry(measured) for measured in tables]}


def _entry(measured: Measured) -> dict[str, Any]:
    rows: list[dict[str, Any]] = []
    for across in zip(*measured.columns.values(), strict=True):  # a row in all columns
        first = across[0]
        _, _, unit = first.form.partition("}")
        values = [row.value for row in across]
        rows.append({"name": first.name.strip(), "values": values, "unit": unit.strip() or None})
    return {"title": measured.title, "columns": list(measured.columns), "rows": rows}


def _cpu() -> str:
    """Return the processor's model, or its kind where the system does not say."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _check_teams(teams: Collection[object]) -> None:
    if len(teams) < 2:
        raise ValueError("growth needs two teams or more that fit, such as --robots 300 1000 3000")


def _team_tables(options: BenchOptions, say: Callable[[str], None]) -> Iterator[Measured]:
    """Measure teams, the smallest first; print which are left out, and why."""
    teams = {}
    for num_robots in sorted(set(options.robots)):
        say(f"Measuring {num_robots} robots ...")
        try:
            teams[str(num_robots)] = list(sim.team_rows(num_robots, options.seconds))
        except ValueError as error:
            plain_console(is_error=True).print(f"{num_robots} robots are left out: {error}")
    _check_teams(teams)
    powers = " and ".join(f"{name}: N^{sim.growth(teams, name)[0]:.2f}" for name in sim.GROWING)
    title = f"Growth of the {min(sim.NUM_FITTED, len(teams))} largest teams: {powers}"
    yield Measured(title, teams, head="robots")
    if options.plot:
        sim.draw_teams(teams, options.plot)


def _tables(options: BenchOptions, say: Callable[[str], None]) -> Iterator[Measured]:
    """Make all requested measurements, and print which one is running."""
    say("Measuring missions side by side ...")
    columns = {
        str(num_missions): list(sim.simulation_rows(num_missions, options.threads, options.seconds))
        for num_missions in options.missions
    }
    title = "Simulation: 40 robots walk at random, policy round-robin"
    yield Measured(title, columns, head="missions side by side")
    say("Measuring obstacles and fading ...")
    title = f"World: one window of one of {WORLD_MISSIONS} such missions"
    yield Measured(title, {"": list(sim.world_rows(WORLD_MISSIONS, options.seconds))})
    say("Measuring how long policies take to decide ...")
    is_left_out = options.no_learning or not is_installed("torch")
    policies = list(POLICIES)
    if is_left_out:
        policies.remove(SHIPPED)
    columns = {
        name: list(bench_decisions.decision_rows(mission, policies, options.seconds / 2))
        for name, mission in bench_decisions.TEAMS.items()
    }
    yield Measured("Time to decide: all 40 robots, one window", columns, head="policy")
    if options.episodes:
        say(f"Measuring an evaluation of {options.episodes} missions ...")
        title = f"Evaluation: {options.episodes} random walks of 40 robots, 500 windows each"
        rows = sim.evaluation_rows(options.episodes, options.jobs, options.seconds)
        yield Measured(title, {"": list(rows)})
    if not options.no_learning:
        say("Measuring networks and training (a minute or two) ...")
        from swarm_mj.cli import bench_learning  # torch is slow to import

        rows = bench_learning.learning_rows(threads=options.threads, seconds=options.seconds)
        yield Measured("Learning: 40 robots at rest", {"": list(rows)})
    say("Measuring robots with bodies ...")
    columns = {
        str(num_missions): list(bench_bodies.body_rows(num_missions, options.seconds))
        for num_missions in BODY_MISSIONS
    }
    title = "Robots with bodies: 40 quadrotors walk at random, policy round-robin"
    yield Measured(title, columns, head="missions side by side")


def _table(measured: Measured) -> Table:
    table = Table(title=measured.title, title_justify="left", show_header=bool(measured.head))
    table.add_column(measured.head)
    for name in measured.columns:
        table.add_column(name, justify="right")
    for rows in zip(*measured.columns.values(), strict=True):
        first, *_ = rows
        shown = (row.form.format(row.value) for row in rows)
        table.add_row(first.name, *shown, end_section=first.ends_section)
    return table
