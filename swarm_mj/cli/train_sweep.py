"""`swarm-mj train --sweep FILE.toml`: a training for each combination of values in a file."""

import shlex
import tempfile
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from swarm_mj.cli import NAME, parse
from swarm_mj.evaluation.engines import Engine
from swarm_mj.learning.run_folder import CURVE, SETTINGS, read_curve
from swarm_mj.protocol.mission_costs import AOI
from swarm_mj.system.arguments import check_kind, check_names
from swarm_mj.system.exit_codes import BAD_INPUT, DONE, FAILED, INTERRUPTED
from swarm_mj.system.fields import as_typed
from swarm_mj.system.processes import PYTHON, running
from swarm_mj.system.reading import read_file
from swarm_mj.system.streams import check_printable
from swarm_mj.system.terminal import WorkBar, plain_console, this_command

MAX_BYTES = 1_000_000
MAX_TRAININGS = 1000
NOT_IN_FILES = ("out", "resume", "sweep", "jobs", "engine", "address")  # of the command line alone
OWN_ENDS = (DONE, FAILED, BAD_INPUT, INTERRUPTED)  # exit codes of a training that ended by itself


class PlannedTraining(NamedTuple):
    """A training of a sweep."""

    folder: Path  # of the run
    command: list[str]  # of `swarm-mj`, in words


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The end of a training in another process."""

    code: int  # its exit code
    said: str  # its last line, which says what went wrong


def read_sweep(path: Path) -> dict[str, list[str]]:
    """Return the options of each training in a file, by its name.

    Args:
        path: A TOML file. Its table [train] has options of `swarm-mj train`, by their names without
            dashes, a list for those that take several values. [sweep] has a list of values for
            each option that is tried; all are combined.

    Raises:
        ValueError: The file is none, has other tables, or too many combinations.
        OSError: It cannot be read.
    """
    try:
        tables = tomllib.loads(read_file(path, "sweep", MAX_BYTES).decode())
        return _trainings(tables)
    except (ValueError, TypeError, RecursionError) as error:
        raise ValueError(f"sweep {path}: {error}") from error


def _trainings(tables: dict[str, Any]) -> dict[str, list[str]]:
    check_names("a sweep", tables, ("train", "sweep"))
    for place in ("train", "sweep"):
        check_kind(f"[{place}]", tables.setdefault(place, {}), dict, "budget = 40000")
    swept = tables["sweep"]
    num_trainings = 1
    for name, values in swept.items():
        check_kind(f"[sweep] {name}", values, list, "seed = [1, 2, 3]")
        num_trainings *= len(values)
    if not 1 <= num_trainings <= MAX_TRAININGS:
        raise ValueError(f"it must have 1 to {MAX_TRAININGS} trainings, not {num_trainings}")
    trainings: dict[str, list[str]] = {}
    for values in product(*swept.values()):
        chosen = dict(zip(swept, values, strict=True))
        options: list[str] = []
        for name, value in (tables["train"] | chosen).items():
            options += _typed(name, value)
        folder = _name(chosen)
        if folder in trainings:
            raise ValueError(
                f"two trainings would have the folder {folder}; leave one out, or give it values "
                "that differ in more than / and :"
            )
        trainings[folder] = options
    return trainings


def _typed(name: str, value: object) -> list[str]:
    """Return an option as it is typed; nothing of a flag that is off."""
    if name.replace("-", "_") in NOT_IN_FILES:
        raise ValueError(f"--{name} belongs on the command line, not into the file")
    if isinstance(value, bool):
        return [f"--{name}"] if value else []
    several = value if isinstance(value, list) else [value]
    words = [as_typed(each) for each in several]
    for word in words:
        check_printable(word, "write it without them")
    return [f"--{name}", *words]


def _name(chosen: dict[str, Any]) -> str:
    """Return the name of a training's folder, by what is its own: such as `seed-1`."""
    parts: list[str] = []
    for name, value in chosen.items():
        several = value if isinstance(value, list) else [value]
        text = "-".join(as_typed(each) for each in several)
        parts.append(f"{name}-{text}".replace("/", "-").replace(":", "-"))
    return "_".join(parts) or "training"


def run_sweep(
    path: Path,
    out: Path,
    engine: Engine,
    check_training: Callable[[Any], object],
    *,
    is_resumed: bool,
) -> int:
    """Train what a file asks for, each in a folder of its own; return the exit code.

    Args:
        path: The file.
        out: The folder of these folders.
        engine: Where trainings run.
        check_training: Raises ValueError for options of `swarm-mj train` that cannot be trained
            with. All are checked before anything is trained.
        is_resumed: Whether trainings that have begun go on.

    Raises:
        ValueError: An option in the file is unknown, or cannot be trained with.
        OSError: A file cannot be read or written, or the engine could not do all.
    """
    trainings: list[PlannedTraining] = []
    for name, options in read_sweep(path).items():
        folder = (out / name).resolve()  # processes elsewhere have other current folders
        has_begun = is_resumed and (folder / SETTINGS).exists()
        command = ["train", *options, "--out", str(folder), *(["--resume"] if has_begun else [])]
        _, asked = parse(command)
        check_training(asked)
        trainings.append(PlannedTraining(folder, command))
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    try:
        failed = _train_all(trainings, engine, console)
    except KeyboardInterrupt:
        console.print("Interrupted; --resume goes on from each training's last checkpoint.")
        return INTERRUPTED
    except OSError as error:
        raise OSError(f"{error}; --resume goes on with the trainings") from error
    if failed:
        raise OSError(
            f"{len(failed)} of {len(trainings)} trainings failed ({', '.join(failed)}); --resume "
            "tries again"
        )
    folders = shlex.join(str(training.folder) for training in trainings)
    plain_console().print(f"Compare: {this_command()} curves {folders}")
    return DONE


def _train_all(trainings: Sequence[PlannedTraining], engine: Engine, console: Console) -> list[str]:
    """Train all, with a line for each; return the names of the runs that failed."""
    codes: dict[int, int] = {}  # exit codes by the trainings' places
    commands = [training.command for training in trainings]
    bar = WorkBar("Training", len(trainings), "trainings", console=console)
    with bar:
        for index, outcome in engine.run(train_apart, commands):
            console.print(_line(trainings[index].folder, outcome), markup=False)
            if outcome.code == INTERRUPTED:
                raise KeyboardInterrupt
            codes[index] = outcome.code
            bar.move_to(len(codes))
    return [trainings[index].folder.name for index in sorted(codes) if codes[index] != DONE]


def train_apart(command: Sequence[str]) -> Outcome:
    """Train in a process of its own, which may be killed and takes no other training with it."""
    with (
        tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as heard,
        running([*PYTHON, "-m", "swarm_mj", *command], output=heard) as process,
    ):
        code = process.wait()
        heard.seek(0)
        lines = heard.read().strip().splitlines()
    if code < 0:
        said = f"was ended by signal {-code}, perhaps for want of memory"
    elif code not in OWN_ENDS:
        said = f"ended with exit code {code}"
    else:
        said = lines[-1].removeprefix(f"{NAME}: error: ") if lines else ""
    return Outcome(code=code, said=said)


def _line(folder: Path, outcome: Outcome) -> str:
    """Return what came of a training, in a line."""
    if outcome.code != DONE or not (folder / CURVE).exists():
        return f"{folder.name}: {outcome.said or 'no evaluation'}"
    rows = read_curve(folder / CURVE)
    best = min(row.aoi for row in rows)
    return (
        f"{folder.name}: {rows[-1].decisions:,.0f} decisions, age {rows[-1].aoi:.2f}, at best "
        f"{best:.2f} {AOI.unit}"
    )
