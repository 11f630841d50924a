"""Every table and figure of the README and the docs, flown from study files at one commit (V).

    python training/results.py                  # make results: hours on two cores
    python training/results.py --scale smoke    # the same structure, a few windows each: minutes
    python training/results.py --studies paper-random-walk channels

Each file of `training/studies/` is a study, flown as `swarm-mj study run` does. `gnn` flies the
trained policies of `reproduce.py`, `crashes` the studies of `crashes.py`; `routes` counts whom
robots address, and `deciding` runs `swarm-mj bench`. Each leaves a table of its name in
`training/results/`: `NAME.csv` has a row for each policy and regime, `NAME.parquet` one for each
mission. What is there of this commit is kept; `--force` flies it again, but for `gnn`: there
`reproduce.py --force` does, and trains anew.
An interrupted run continues where it broke off. Then `tools/results_table.py` writes the numbers
into the docs, and `make figures` draws them.
"""

import csv
import io
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import chdir, redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path

import bounds
import crashes
import flocking_converges
import reproduce
import routes

from swarm_mj.cli import main as swarm_mj
from swarm_mj.cli import script
from swarm_mj.cli.evaluate import StudyFlags, run_study
from swarm_mj.cli.study import read_study
from swarm_mj.evaluation.results import Result
from swarm_mj.evaluation.results_files import read_results, write_results
from swarm_mj.evaluation.study import Study
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import setting
from swarm_mj.system.packages import commit
from swarm_mj.system.reading import read_file, read_json
from swarm_mj.system.writing import Output, check_outputs, write_bytes, write_csv

ROOT = Path(__file__).resolve().parent.parent
SCALES = ("paper", "smoke")
MISSIONS, WINDOWS = 2, 12  # of smoke, each study's
FOLDER = ROOT / "training" / "studies"
SHIPPED = {"impairments": "impairments-small"}  # with the package, under other names
STUDIES = tuple(sorted([*SHIPPED, *(path.stem for path in FOLDER.glob("*.toml"))]))
# No study describes these.
OTHERS = ("gnn", "routes", "floor", "converging-courses", "crashes", "deciding")
KINDS = (".csv", ".parquet")
MAX_BYTES = 100_000_000


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is flown, and where it goes."""

    scale: str = setting("paper", "how much is flown", choices=SCALES)
    studies: tuple[str, ...] = setting(
        (*STUDIES, *OTHERS),
        "which tables",
        choices=(*STUDIES, *OTHERS),
        shown="all",
    )
    results: Path | None = setting(
        None,
        "where tables go",
        metavar="DIR",
        shown="training/results, or runs/smoke",
    )
    jobs: int = setting(os.cpu_count() or 1, "missions at once", low=1, high=256)
    force: bool = setting(False, "fly everything again")

    @property
    def is_smoke(self) -> bool:
        """Whether only the structure is tried."""
        return self.scale == "smoke"

    @property
    def folder(self) -> Path:
        """Where tables go."""
        usual = ROOT / "runs" / "smoke" if self.is_smoke else ROOT / "training" / "results"
        return (self.results or usual).absolute()

    @property
    def drafts(self) -> Path:
        """Where tables wait until all of their missions have flown."""
        return self.results / "drafts" if self.results else ROOT / "runs" / "results" / self.scale


def study_of(name: str) -> Study:
    """Return a study by the name of its table."""
    return read_study(SHIPPED.get(name, str(FOLDER / f"{name}.toml")), is_trusted=True)


def smoked(study: Study) -> Study:
    """Return a study of the same policies and regimes, with few short missions."""
    regimes = tuple(replace(regime, num_windows=WINDOWS) for regime in study.regimes)
    return replace(study, episodes=MISSIONS, regimes=tuple(dict.fromkeys(regimes)))


def fly_study(settings: Settings, name: str) -> int:
    """Fly a study, or the rest of it; return the exit code."""
    drafts = [settings.drafts.absolute() / f"{name}{kind}" for kind in KINDS]
    code = fly_drafts(settings, study_of(name), drafts)
    for draft in drafts:
        if code == DONE:
            write_bytes(settings.folder / draft.name, read_file(draft, "draft", MAX_BYTES))
            draft.unlink()
    return code


def fly_drafts(settings: Settings, study: Study, drafts: Sequence[Path]) -> int:
    """Fly a study, or the rest of it, into a CSV and a Parquet file; return the exit code."""
    study = smoked(study) if settings.is_smoke else study
    csv_path, parquet_path = drafts
    say(f"{csv_path.stem}: {study.num_missions:,} missions")
    how = {"jobs": settings.jobs, "resume": not settings.force, "force": settings.force}
    with redirect_stdout(io.StringIO()):  # the tables are printed nowhere: they are in the docs
        return run_study(StudyFlags(csv=csv_path, parquet=parquet_path, **how), study)


def fly_crashes(settings: Settings) -> int:
    """Fly robots that avoid each other by news of different ages; return the exit code."""
    drafts: list[Path] = []
    rows: list[Result] = []
    for name, study in crashes.studies().items():
        pair = [settings.drafts.absolute() / f"crashes-{name}{kind}" for kind in KINDS]
        code = fly_drafts(settings, study, pair)
        if code != DONE:
            return code
        rows += read_results(pair[0])
        drafts += pair
    write_results(settings.folder / "crashes.csv", rows)
    for draft in drafts:
        draft.unlink()
    return DONE


def fly_floor(settings: Settings) -> int:
    """Compute the floor of `docs/bounds.md`; return the exit code."""
    usual = bounds.Settings(out=settings.folder / "floor.csv")
    return bounds.run(replace(usual, teams=MISSIONS, seconds=0.1) if settings.is_smoke else usual)


def fly_courses(settings: Settings) -> int:
    """Fly flocks until they agree, window by window; return the exit code."""
    usual = flocking_converges.Settings(
        out=settings.folder / "converging-courses.csv", late=settings.folder / "converging-late.csv"
    )
    few = {"num_missions": MISSIONS, "late_missions": MISSIONS, "sizes": (10,)}
    return flocking_converges.run(replace(usual, **few) if settings.is_smoke else usual)


def fly_gnn(settings: Settings) -> int:
    """Fly the policies that `reproduce.py` trained; return the exit code."""
    usual = reproduce.Settings(jobs=settings.jobs)
    if not settings.is_smoke:
        if settings.force:
            for path in (usual.results / usual.scale).glob("*.csv"):
                path.unlink()
        return reproduce.run(usual)
    few = f"--episodes {MISSIONS} --windows {WINDOWS}"
    return reproduce.run(replace(usual, fly=few, results=settings.folder / "reproduce"))


def fly_routes(settings: Settings) -> int:
    """Fly teams at rest, and count whom their robots address; return the exit code."""
    usual = routes.Settings(out=settings.folder / "routes.csv")
    few = {"num_missions": MISSIONS, "num_windows": 10 * WINDOWS, "ratios": (1.0,)}
    return routes.run(replace(usual, **few) if settings.is_smoke else usual)


def measure_deciding(settings: Settings) -> int:
    """Time this machine, and the policies' decisions; return the exit code."""
    path, out = settings.folder / "bench.json", settings.folder / "deciding.csv"
    few = ["--missions", "1", "--seconds", "0.1", "--no-learning"] if settings.is_smoke else []
    code = swarm_mj(["bench", "--episodes", "0", *few, "--json", str(path), "--force"])
    if code == DONE:
        found = read_json(read_file(path, "bench", MAX_BYTES), dict)
        [table] = [each for each in found["tables"] if each["title"].startswith("Time to decide")]
        rows: list[dict[str, object]] = []
        for row in table["rows"]:
            walking_us, resting_us = row["values"]
            rows.append(
                {
                    "policy": row["name"],
                    "walking_ms": walking_us / 1e3,
                    "at_rest_ms": resting_us / 1e3,
                    "commit": found["commit"],
                }
            )
        write_csv(out, tuple(rows[0]), rows)
    return code


FLOWN_BY: dict[str, Callable[[Settings], int]] = {
    "deciding": measure_deciding,
    "floor": fly_floor,
    "converging-courses": fly_courses,
    "crashes": fly_crashes,
    "gnn": fly_gnn,
    "routes": fly_routes,
}


def is_current(path: Path) -> bool:
    """Return whether a table is there, of this commit alone."""
    if not path.exists():
        return False
    rows = csv.DictReader(read_file(path, "table", MAX_BYTES).decode().splitlines())
    return {row["commit"] for row in rows} == {commit()}


def run(settings: Settings) -> int:
    """Fly what is missing; return the exit code."""
    check_outputs(
        *(Output("results", settings.folder / f"{each}.csv") for each in settings.studies)
    )
    for number, name in enumerate(settings.studies, start=1):
        if not settings.force and is_current(settings.folder / f"{name}.csv"):
            say(f"{name}: {settings.folder / name}.csv is there; --force flies it again")
            continue
        say(f"Table {number} of {len(settings.studies)}")
        with chdir(ROOT):
            code = FLOWN_BY[name](settings) if name in OTHERS else fly_study(settings, name)
        if code != DONE:
            say("The same command continues here.")
            return code
    return DONE


def say(line: str) -> None:
    """Print a line of progress."""
    sys.stderr.write(f"{line}\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment; return its exit code."""
    return script(Settings, run, arguments)


if __name__ == "__main__":
    sys.exit(main())
