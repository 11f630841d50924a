"""The paper's learned policies and the recipes of docs/training.md, trained and flown again (V).

    python training/reproduce.py --force    # make reproduce: trains all anew, then flies them
    python training/reproduce.py            # flies those that were trained: a part of make results

What is trained and flown, and with which options, stands in `training/reproduce/`, one file a
figure; the policies that were trained stand beside it, by scale and figure. `quick` has one to
ten hundredths of the authors' budget, `full` all of it; recipes have their own. Policies that are
there are not trained again, and flights of this commit not flown again, unless `--force` says so.
An interrupted run goes on where it broke off, as long as the commit is the same.
"""

import hashlib
import json
import shlex
import shutil
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from experiments import MOST_BYTES, Experiment, Scale, Settings, read_experiment, typed

from swarm_mj.cli import main as swarm_mj
from swarm_mj.cli import parse, script
from swarm_mj.evaluation.results import Result
from swarm_mj.evaluation.results_files import read_results, write_results
from swarm_mj.learning.run_folder import CURVE, SETTINGS, read_run
from swarm_mj.policies.policy_config import SUFFIX
from swarm_mj.policies.registry import POLICIES
from swarm_mj.policies.stored import POLICY, read_weights
from swarm_mj.system import writing
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.packages import code_digest, commit
from swarm_mj.system.reading import read_file, read_json, read_rows
from swarm_mj.system.writing import Output, check_outputs

BEGUN = "begun.json"  # what a figure's runs were begun with
CURVE_COLUMNS = (
    "training", "decisions", "minutes", "aoi", "aoi_sem", "velocity_variance",
    "packets_per_window", "delivery_ratio",
)  # fmt: skip
TRAINING_COLUMNS = (
    "training", "options", "decisions", "minutes", "best_decisions", "commit", "experiment",
    "settings",
)  # fmt: skip


class Failed(Exception):  # noqa: N818 - as KeyboardInterrupt
    """A command has said why, and its exit code is the experiment's."""

    def __init__(self, code: int) -> None:
        """Take the command's exit code."""
        super().__init__(f"exit code {code}")
        self.code = code


class Tables(NamedTuple):
    """The files that a figure leaves."""

    flights: Path  # what its flights cost
    trainings: Path  # a row for each of its policies
    curves: Path  # of their trainings


class PlannedFlights(NamedTuple):
    """An evaluation of what was trained, which is to be flown."""

    draft: Path  # of its results
    command: list[str]  # the arguments of `swarm-mj` that make it
    curves: dict[str, list[str]]  # of the figure, by the policies that are flown


@dataclass(frozen=True, kw_only=True)
class Work:
    """One figure at one scale."""

    figure: str
    settings: Settings
    experiment: Experiment

    @property
    def scale(self) -> Scale:
        """The options that its trainings share, and its flights."""
        return getattr(self.experiment, self.settings.scale)

    @property
    def folder(self) -> Path:
        """The folder of its runs and drafts."""
        return self.settings.runs / self.settings.scale / self.figure

    @property
    def digest(self) -> str:
        """A digest of everything in its file that the trainings of this scale depend on."""
        said = (self.scale.train, self.scale.own, self.experiment.trainings)
        return hashlib.sha256(json.dumps(said).encode()).hexdigest()[:12]

    @property
    def tables(self) -> Tables:
        """The files it leaves."""
        return Tables(
            flights=self.settings.results / self.settings.scale / f"{self.figure}.csv",
            trainings=self.kept / "trainings.csv",
            curves=self.kept / "curves.csv",
        )

    @property
    def kept(self) -> Path:
        """The folder of what its trainings left."""
        return self.settings.policies / self.settings.scale / self.figure

    @property
    def is_trained(self) -> bool:
        """True if the policies of this very experiment are there, and the tables of them."""
        tables = [self.tables.trainings, self.tables.curves]
        paths = [*tables, *map(self.policy, self.experiment.trainings)]
        if not all(path.exists() for path in paths):
            return False
        rows = read_rows(self.tables.trainings, "table of trainings")
        return {row.get("experiment") for _, row in rows} == {self.digest}

    @property
    def is_flown(self) -> bool:
        """True if the flights' results are there, of this commit."""
        return _is_current(self.tables.flights)

    def policy(self, name: str) -> Path:
        """Return where the policy of a training is kept."""
        return self.kept / f"{name}{SUFFIX}"

    @cached_property
    def trainings(self) -> dict[str, list[str]]:
        """The arguments of `swarm-mj` that begin each training."""
        return {
            name: ["train", *self._options(name), "--out", _from_here(self.folder / name)]
            for name in self.experiment.trainings
        }

    @cached_property
    def flights(self) -> list[PlannedFlights]:
        """The evaluations that fly what was trained."""
        planned: list[PlannedFlights] = []
        for number, (missions, curves) in enumerate(self.experiment.flights.items()):
            draft = self.folder / f"flights-{number}.csv"
            command = self._evaluate(missions, curves, draft)
            planned.append(PlannedFlights(draft=draft, command=command, curves=curves))
        return planned

    def _options(self, name: str) -> list[str]:
        """Return a training's options: the scale's, its own, and its own at this scale."""
        own = shlex.join(typed(self.experiment.trainings[name], self.scale.own.get(name, "")))
        return typed(self.scale.train, own)

    def _evaluate(self, missions: str, flown: Iterable[str], draft: Path) -> list[str]:
        policies = [self._flown(name) for name in flown]
        options = typed(shlex.join(typed(self.scale.fly, missions)), self.settings.fly)
        jobs = ["--jobs", f"{self.settings.jobs}"]
        return ["evaluate", "--policy", *policies, *options, *jobs, "--csv", str(draft), "--resume"]

    def _flown(self, name: str) -> str:
        """Return what `swarm-mj` calls the policy of a training, or a rule that flies beside it."""
        if name in self.experiment.trainings:
            return str(self.policy(name))
        if name in POLICIES:
            return name
        known = ", ".join(self.experiment.trainings)
        raise ValueError(f"{self.figure} flies {name!r}, but trains only {known}")

    def check(self) -> None:
        """Pass if all commands can be read, and all tables written.

        Raises:
            ValueError: Not so, or runs have begun otherwise.
            SystemExit: A command cannot be read.
        """
        check_outputs(*(Output("results", path) for path in self.tables))
        for command in (*self.trainings.values(), *(each for _, each, _ in self.flights)):
            parse(command)
        if self.folder.exists() and not self.is_trained:
            begun = self._begun()
            if begun != self._now() and not self.settings.force:
                raise ValueError(
                    f"{self.folder} was begun with another experiment or at another commit, "
                    f"{begun.get('commit')}, not {commit()}; go back to it, or give --force to "
                    "start over"
                )

    def _now(self) -> dict[str, Any]:
        return {"experiment": self.digest, "commit": commit(), "code": code_digest()}

    def _begun(self) -> dict[str, Any]:
        if not (self.folder / BEGUN).exists():
            raise ValueError(f"{self.folder} is there, but no runs of this; name other --runs")
        return read_json(read_file(self.folder / BEGUN, "beginning", MOST_BYTES), dict)

    def do(self) -> None:
        """Train and fly what is missing, with its tables; raise Failed if a command does."""
        if not self.is_trained:
            writing.write_json(self.folder / BEGUN, self._now())
            for number, (name, command) in enumerate(self.trainings.items(), start=1):
                _say(f"{self.figure}: training {number} of {len(self.trainings)}, {name}")
                self._train(name, command)
            self._keep()
        for planned in self.flights:
            if not _is_current(planned.draft):
                planned.draft.unlink(missing_ok=True)
                _run(planned.command)
        write_results(self.tables.flights, list(self._results()))
        for planned in self.flights:
            planned.draft.unlink()

    def _train(self, name: str, command: list[str]) -> None:
        """Train one, or resume it; leave one alone that came to its end."""
        run, ended = self.folder / name, self.folder / f"{name}.trained"
        if not ended.exists():
            _run([*command, "--resume"] if (run / SETTINGS).exists() else command)
            writing.write_text(ended, "")

    def _keep(self) -> None:
        """Keep the policies, and write the tables of trainings, which say whose they are, last."""
        rows = {name: _rows(self.folder / name / CURVE) for name in self.trainings}
        table: list[dict[str, Any]] = []
        for name, curve in rows.items():
            table += [{"training": name} | row for row in curve]
        writing.write_csv(
            self.tables.curves,
            CURVE_COLUMNS,
            ({name: row.get(name) for name in CURVE_COLUMNS} for row in table),
        )
        for name in self.trainings:
            trained = read_file(self.folder / name / POLICY, "policy", MOST_BYTES)
            writing.write_bytes(self.policy(name), trained)
        trainings = map(self._training, rows, rows.values())
        writing.write_csv(self.tables.trainings, TRAINING_COLUMNS, trainings)

    def _training(self, name: str, rows: Sequence[dict[str, Any]]) -> dict[str, object]:
        """Return a row of the table of trainings."""
        _, config = read_weights(self.folder / name / POLICY)
        return {
            "training": name,
            "options": shlex.join(self._options(name)),
            "decisions": int(rows[-1]["decisions"]),
            "minutes": rows[-1]["minutes"],
            "best_decisions": config.training["decisions"],  # of the policy that was kept
            "commit": self._begun()["commit"],
            "experiment": self.digest,
            "settings": json.dumps(asdict(read_run(self.folder / name, named=None).training)),
        }

    def _results(self) -> Iterator[Result]:
        """Return the flights' results under their curves' names, with what was trained."""
        trained = read_rows(self.tables.trainings, "table of trainings")
        decisions = {row["training"]: int(row["decisions"]) for _, row in trained}
        for planned in self.flights:
            curves = planned.curves
            paths = {self._flown(name): name for name in curves}
            for result in read_results(planned.draft):
                name = paths[result.policy]
                own: dict[str, object] = {"policy": name}  # the folder is this machine's
                if name in decisions:
                    own["decisions"] = decisions[name]
                config = json.dumps(read_json(result.config, dict) | own)
                for curve in curves[name]:
                    baseline = paths[result.baseline]
                    yield replace(result, policy=curve, baseline=baseline, config=config)


def _from_here(path: Path) -> str:
    """Return a path from the current folder if it is in it: the policy's card keeps it."""
    return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


def _is_current(path: Path) -> bool:
    """Return whether a file has results of this commit."""
    return path.exists() and {result.commit for result in read_results(path)} == {commit()}


def run(settings: Settings) -> int:
    """Run the experiments; return the exit code."""
    works = [read_work(name, settings) for name in settings.figures]
    left = [w for w in works if settings.force or not (w.is_trained and w.is_flown)]
    for work in left:
        work.check()
    if settings.force:
        for work in works:
            _remove(work)
    for work in works:
        if work not in left:
            _say(f"{work.figure}: {work.tables.flights} is there; --force makes it anew")
    try:
        for work in left:
            work.do()
    except Failed as failed:
        return failed.code
    return DONE


def read_work(figure: str, settings: Settings) -> Work:
    """Return a figure's experiment; raises ValueError for a file that is no such thing."""
    experiment = read_experiment(settings.experiments / f"{figure}.toml")
    return Work(figure=figure, settings=settings, experiment=experiment)


def _remove(work: Work) -> None:
    """Remove a figure's results and runs."""
    for path in (*work.tables, *map(work.policy, work.experiment.trainings)):
        path.unlink(missing_ok=True)
    if work.folder.exists():
        shutil.rmtree(work.folder)


def _rows(path: Path) -> list[dict[str, Any]]:
    """Return a run's learning curve."""
    rows = read_rows(path, "learning curve")
    return [{name: float(cell) if cell else None for name, cell in row.items()} for _, row in rows]


def _say(line: str) -> None:
    sys.stderr.write(f"{line}\n")


def _run(command: Sequence[str]) -> None:
    _say(f"$ swarm-mj {shlex.join(command)}")
    code = swarm_mj(command)
    if code:
        raise Failed(code)


if __name__ == "__main__":
    sys.exit(script(Settings, run))
