"""`swarm-mj curves`: the learning curves of training runs, as a table and as a figure."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from swarm_mj.cli.mission_options import mission_flags
from swarm_mj.cli.options import flags_of
from swarm_mj.cli.train_report import difference
from swarm_mj.cli.train_settings import SPECS_BY_PLACE
from swarm_mj.evaluation.figures import quiet_matplotlib
from swarm_mj.learning.run_folder import (
    CURVE,
    SETTINGS,
    CurvePoint,
    TrainingRun,
    read_curve,
    read_run,
)
from swarm_mj.learning.selection import column
from swarm_mj.learning.settings import Training
from swarm_mj.mission import Mission
from swarm_mj.protocol.mission_costs import AOI
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import as_typed, files_read, setting
from swarm_mj.system.terminal import plain_console, say_written
from swarm_mj.system.writing import Output, check_outputs, write_csv

if TYPE_CHECKING:  # matplotlib is slow to import
    from swarm_mj.api.charts import LearningCurve


@dataclass(frozen=True, kw_only=True)
class Learned:
    """A training run that has been evaluated."""

    folder: Path
    asked: TrainingRun  # what it was to do
    rows: list[CurvePoint]  # its evaluations, at least one


def _files_of_run(folder: Path) -> list[Path]:
    """Return what is read of a run; a figure may well stand beside it, in its folder."""
    return [folder / SETTINGS, folder / CURVE]


@dataclass(frozen=True, kw_only=True)
class CurvesOptions:
    """The options of `swarm-mj curves`."""

    run: tuple[Path, ...] = setting(
        help="folders that `swarm-mj train` wrote; those that differ only in their seed are a line",
        metavar="RUN",
        is_positional=True,
        reads=_files_of_run,
    )
    plot: Path | None = setting(None, "draw the curves", metavar="FILE.png|.svg|.pdf")
    csv: Path | None = setting(
        None, "write a row for each run, with the options that differ", metavar="FILE.csv"
    )
    force: bool = setting(False, "replace existing files")


def run(options: CurvesOptions) -> int:
    """Run the command; return its exit code."""
    check_outputs(
        Output("--plot", options.plot, ".png|.svg|.pdf"),
        Output("--csv", options.csv, ".csv"),
        inputs=files_read(options),
        must_be_new=not options.force,
    )
    runs = [_read(folder) for folder in dict.fromkeys(options.run)]
    missions = _missions(runs[0].asked.training)
    for each in runs:
        others = _missions(each.asked.training)
        if others != missions:
            raise ValueError(f"missions differ, {missions} and {others}; draw these runs apart")
    levels = runs[0].rows[0].references
    console = plain_console()
    for line in (*_table(runs, levels), *_comparisons(runs)):
        console.print(line)
    if options.plot:
        quiet_matplotlib()
        from swarm_mj.api.charts import draw_learning  # matplotlib is slow to import
        from swarm_mj.evaluation.figures.style import save

        lines = _lines(runs)
        origin = f"evaluated on {missions}"
        if len(lines) < len(runs):
            origin += "; mean over seeds, and their range"
        save(draw_learning(lines, levels, origin), options.plot)
        say_written(options.plot)
    if options.csv:
        _write_csv(options.csv, runs)
        say_written(options.csv)
    return DONE


def _read(folder: Path) -> Learned:
    if not (folder / SETTINGS).is_file():
        raise ValueError(f"{folder} is no run; name a folder that `swarm-mj train` wrote")
    rows = read_curve(folder / CURVE) if (folder / CURVE).exists() else []
    if not rows:
        raise ValueError(f"{folder} has no evaluation yet; wait for one, or train on by --resume")
    return Learned(folder=folder, asked=read_run(folder, named=None), rows=rows)


def _missions(training: Training) -> str:
    """Return the options that make the missions of a run's evaluations."""
    size = Mission().num_robots
    flags = mission_flags(*(replace(each, num_robots=size) for each in training.all_missions))
    own = "".join(f" --{kind} {name}" for kind, name in training.components.names.items())
    sizes = " ".join(map(str, training.robots))
    return f"{flags} --robots {sizes} --held-out {training.held_out}{own}"


def _table(runs: Sequence[Learned], levels: Mapping[str, float]) -> Iterator[str]:
    """Yield a heading, a line for each run, and one for each reference policy."""
    names = [str(each.folder) for each in runs]
    width = max(len(name) for name in [*names, *levels])
    yield f"{'run':{width}}   seed   decisions  best age  last age [{AOI.unit}]"
    for name, each in zip(names, runs, strict=True):
        last = each.rows[-1]
        best_age = min(row.aoi for row in each.rows)
        numbers = f"{last.decisions:11,.0f} {best_age:9.2f} {last.aoi:9.2f}"
        yield f"{name:{width}} {each.asked.training.seed:6} {numbers}"
    for policy, age in levels.items():
        yield f"{policy:{width}} {age:38.2f}"


def _comparisons(runs: Sequence[Learned]) -> Iterator[str]:
    """Yield how each run's last policy, which nothing selected, compares with the references."""
    for each in runs:
        compared = each.rows[-1].compared
        said = [difference(name, cost, AOI) for name, cost in compared.items()]
        if said:
            yield f"{each.folder}: the last policy {'; '.join(said)}."


def _options_that_differ(runs: Sequence[Learned]) -> dict[str, list[str]]:
    """Return each run's values of the options that differ between runs, by the options' names."""
    found: dict[str, list[str]] = {}
    for place, spec in SPECS_BY_PLACE.items():
        if not place.startswith("mission."):  # which are the same
            name = flags_of(spec)[0].removeprefix("--")
            found[name] = [as_typed(attrgetter(place)(each.asked.training)) for each in runs]
    found["init"] = ["" if each.asked.init is None else str(each.asked.init) for each in runs]
    return {name: values for name, values in found.items() if len(set(values)) > 1}


def _write_csv(path: Path, runs: Sequence[Learned]) -> None:
    """Write a row for each run: what is its own, its best and its last age, and the references'."""
    differing = _options_that_differ(runs)
    rows: list[dict[str, object]] = []
    for number, each in enumerate(runs):
        last = each.rows[-1]
        row: dict[str, object] = {"run": str(each.folder), "seed": each.asked.training.seed}
        for name, values in differing.items():
            row[name] = values[number]
        row["decisions"] = int(last.decisions)
        row["aoi_best"] = min(point.aoi for point in each.rows)
        row["aoi_last"] = last.aoi
        row["aoi_last_sem"] = last.aoi_sem
        for policy, age in last.references.items():
            row[column(AOI, policy)] = age  # as in curve.csv
        rows.append(row)
    names: dict[str, None] = {}  # in order; not all runs need have the same references
    for row in rows:
        names.update(dict.fromkeys(row))
    write_csv(path, list(names), rows)


def _lines(runs: Sequence[Learned]) -> "dict[str, LearningCurve]":
    """Return a line, by its label, for the runs that differ only in their seed."""
    groups: dict[tuple[Training, Path | None], list[Learned]] = {}
    for each in runs:
        alike = replace(each.asked.training, seed=0), each.asked.init
        groups.setdefault(alike, []).append(each)
    differing = _options_that_differ([group[0] for group in groups.values()])
    differing.pop("seed", None)  # over which a line is the mean
    lines: dict[str, LearningCurve] = {}
    for number, group in enumerate(groups.values()):
        own = [f"{name.replace('-', ' ')} {values[number]}" for name, values in differing.items()]
        num_seeds = len({each.asked.training.seed for each in group})
        if num_seeds > 1:
            own.append(f"{num_seeds} seeds")
        label = ", ".join(own)
        if not own or label in lines:  # what differs is no option, such as a setting of 1.0.0
            label = f"{group[0].folder}: {label}" if own else str(group[0].folder)
        lines[label] = _line(group)
    return lines


def _line(group: Sequence[Learned]) -> "LearningCurve":
    """Return the ages of runs where all of them have been evaluated."""
    from swarm_mj.api.charts import LearningCurve  # matplotlib is slow to import

    ages_at: list[dict[float, float]] = []  # of each run, by the decisions behind them
    for each in group:
        own = {row.decisions: row.aoi for row in each.rows}
        ages_at.append(own)
    shared = set(ages_at[0])
    for own in ages_at:
        shared &= set(own)
    decisions = sorted(shared)
    age = np.empty((len(group), len(decisions)))
    for r, own in enumerate(ages_at):
        age[r] = [own[at] for at in decisions]
    return LearningCurve(
        decisions=np.array(decisions, dtype=float),
        age=age.mean(axis=0),
        low=age.min(axis=0),
        high=age.max(axis=0),
    )
