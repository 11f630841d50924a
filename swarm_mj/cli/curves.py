"""`swarm-mj curves`: the learning curves of training runs, as a table and as a figure."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from swarm_mj.cli.mission_options import mission_flags
from swarm_mj.evaluation.figures import quiet_matplotlib
from swarm_mj.learning.run_folder import CURVE, SETTINGS, TrainingRun, read_curve, read_run
from swarm_mj.learning.selection import REFERENCES, Row, column
from swarm_mj.learning.settings import Training
from swarm_mj.mission import Mission
from swarm_mj.system.fields import setting
from swarm_mj.system.terminal import plain_console
from swarm_mj.system.writing import Output, check_outputs

Learned = tuple[Path, TrainingRun, list[Row]]  # its folder, what was asked for, its evaluations


@dataclass(frozen=True, kw_only=True)
class CurvesOptions:
    """The options of `swarm-mj curves`."""

    run: tuple[Path, ...] = setting(
        help="folders that `swarm-mj train` wrote; those that differ only in their seed are a line",
        metavar="RUN",
        is_positional=True,
    )
    plot: Path | None = setting(None, "draw the curves", metavar="FILE.png|.svg|.pdf")
    force: bool = setting(False, "replace an existing figure")


def run(options: CurvesOptions) -> int:
    """Run the command; return its exit code."""
    check_outputs(Output("--plot", options.plot, ".png|.svg|.pdf"), must_be_new=not options.force)
    runs = [_read(folder) for folder in dict.fromkeys(options.run)]
    missions, *others = dict.fromkeys(_missions(asked.training) for _, asked, _ in runs)
    if others:
        raise ValueError(f"missions differ, {missions} and {others[0]}; draw these runs apart")
    first, console = runs[0][2][0], plain_console()
    levels = {name: first[cost] for name in REFERENCES if (cost := column("aoi", name)) in first}
    wide = max(len(str(name)) for name in (*options.run, *levels))
    console.print(f"{'run':{wide}}   seed   decisions  best age  last age [windows]")
    for folder, asked, rows in runs:
        best, last = min(row["aoi"] for row in rows), rows[-1]
        numbers = f"{last['decisions']:11,.0f} {best:9.2f} {last['aoi']:9.2f}"
        console.print(f"{folder!s:{wide}} {asked.training.seed:6} {numbers}")
    for policy, age in levels.items():
        console.print(f"{policy:{wide}} {age:38.2f}")
    if options.plot:
        quiet_matplotlib()
        from swarm_mj.api.charts import draw_learning  # matplotlib is slow to import
        from swarm_mj.evaluation.figures.style import save

        save(draw_learning(_lines(runs), levels, f"evaluated on {missions}"), options.plot)
        console.print(f"Wrote {options.plot}")
    return 0


def _read(folder: Path) -> Learned:
    if not (folder / SETTINGS).is_file():
        raise ValueError(f"{folder} is no run; name a folder that `swarm-mj train` wrote")
    if not (folder / CURVE).exists() or not (rows := read_curve(folder / CURVE)):
        raise ValueError(f"{folder} has no evaluation yet; wait for one, or train on by --resume")
    return folder, read_run(folder, named=None), rows


def _missions(training: Training) -> str:
    """Return the options that make the missions of a run's evaluations."""
    flags = mission_flags(replace(training.mission, num_robots=Mission().num_robots))
    own = "".join(f" --{kind} {name}" for kind, name in training.components.names.items())
    sizes = " ".join(map(str, training.robots))
    return f"{flags} --robots {sizes} --held-out {training.held_out}{own}"


def _lines(runs: Sequence[Learned]) -> dict[str, np.ndarray]:
    """Return a line for the runs that differ only in their seed, as `draw_learning` takes it."""
    groups: dict[tuple[Training, Path | None], list[Learned]] = {}
    for each in runs:
        alike = replace(each[1].training, seed=0), each[1].init
        groups.setdefault(alike, []).append(each)
    lines = {}
    for group in groups.values():
        folders, asked, rows = zip(*group, strict=True)
        curves = [{row["decisions"]: row["aoi"] for row in its} for its in rows]
        shared = sorted(set.intersection(*map(set, curves)))
        ages = np.array([[curve[x] for x in shared] for curve in curves])
        label = str(folders[0])
        if len(group) > 1:
            num_seeds = len({each.training.seed for each in asked})
            label += f" to {folders[-1].name}: mean and range of {num_seeds} seeds"
        lines[label] = np.array([shared, ages.mean(axis=0), ages.min(axis=0), ages.max(axis=0)])
    return lines
