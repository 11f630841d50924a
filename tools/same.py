"""Proves that a refactoring left every flight, result and training equal to the last digit.

    make same                            compares with tests/golden/same.json
    make same ARGS=--write               writes it anew
    make same ARGS="--against HEAD~3"    flies that revision, too, and compares with it
    make same ARGS="--only 'planner*'"   flies some only

It flies the short missions of `same_flights.py` and takes a digest of all that each leaves, window
by window; so it can name the window in which a flight moved first. Digests depend on the machine's
floating point. Of another machine's, only `--against` can say whether anything moved.

Only public names of swarm_mj and its command line are used, so that the same tool flies revisions
before and after code has moved. Exit codes: 0 equal, 1 something moved, 2 bad input, 130
interrupted.
"""

import argparse
import csv
import dataclasses
import fnmatch
import hashlib
import io
import json
import os
import platform
import runpy
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import redirect_stderr, redirect_stdout
from importlib.metadata import PackageNotFoundError, version
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from same_flights import FLIGHTS, RESULTS, TRAININGS, Comparison, Flight, write_files

ROOT = Path(__file__).resolve().parents[1]
GOLDEN = ROOT / "tests" / "golden" / "same.json"
REVISIONS = ROOT / ".venv" / "same"  # their packages, with what numba compiled of them
RESULTS_TASK = "results"
EQUAL = 0
MOVED = 1
BAD_INPUT = 2
INTERRUPTED = 130
FAILED = "failed: "  # begins the trace of a task that raised an error
WINDOWS_BEFORE_RESTART = 5
# Sums depend on the number of threads that share them.
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
# How long things took, and who made them, says nothing about what was made.
OTHER_COLUMNS = ("version", "commit", "minutes", "rollout/decisions_per_s")
PACKAGES = ("numpy", "numba", "mujoco", "torch", "scipy")

# A task's traces by name: the digest of the whole, a blank, and of each step two digits.
Traces = dict[str, str]


class Tracer:
    """Digests of what a task leaves, step by step."""

    def __init__(self) -> None:
        self._whole = hashlib.blake2b(digest_size=8)
        self._steps = ""

    def add(self, *values: object) -> None:
        """Add one step's numbers and texts."""
        step = hashlib.blake2b(digest_size=8)
        for value in values:
            step.update(_plain(value))
        self._whole.update(step.digest())
        self._steps += step.hexdigest()[:2]

    @property
    def trace(self) -> str:
        """The digest of the whole, and of each step."""
        return f"{self._whole.hexdigest()} {self._steps}"


def _plain(value: object) -> bytes:
    """Return a value as bytes that do not depend on how wide its numbers are stored."""
    if value is None or isinstance(value, str):
        return repr(value).encode()
    array = np.asarray(value)
    kind = np.float64 if array.dtype.kind == "f" else np.int64
    return f"{array.shape}".encode() + np.ascontiguousarray(array, dtype=kind).tobytes()


# What flies.


def mission_of(flight: Flight) -> Any:  # noqa: ANN401 - a Mission, whose home may move
    """Return a flight's mission."""
    import swarm_mj

    papers: dict[str, Any] = {"paper": swarm_mj.paper, "reference": swarm_mj.reference}
    if flight.preset in papers:
        return papers[flight.preset](flight.task, **flight.fields)
    # The other presets have public names as arguments of `fly` only.
    fields = {**flight.fields, "preset": flight.preset, "num_windows": 1}
    run = swarm_mj.fly(flight.task, policy="tdma", record=False, **fields)
    return dataclasses.replace(run.mission, num_windows=flight.fields["num_windows"])


def fly(flight: Flight) -> str:
    """Fly a flight, and return its trace, a step for each window."""
    import swarm_mj

    mission = mission_of(flight)
    parts = {
        kind: part if part is None or isinstance(part, str) else part()
        for kind, part in flight.parts.items()
    }
    swarm = swarm_mj.Swarm(mission, flight.seeds, num_threads=flight.num_threads, **parts)
    policy = flight.policy
    if isinstance(policy, str):
        policy = swarm_mj.make_policy(policy, mission, **flight.how)
    else:
        policy = policy()
    if flight.restarts:
        swarm.start(policy)
        for _ in range(WINDOWS_BEFORE_RESTART):
            swarm.step()
        swarm.restart([seed + 100 for seed in flight.seeds])
    swarm.start(policy)
    tracer = Tracer()
    for _ in range(mission.num_windows):
        costs = swarm.step()
        tracer.add(*left_by(swarm, costs))
    return tracer.trace


def left_by(swarm: Any, costs: Any) -> list[object]:  # noqa: ANN401 - as above
    """Return all that a window leaves: buffers, packets, true states and costs."""
    views = swarm.views
    states = swarm.states
    known = views.buffers
    left: list[object] = [views.now, known.timestamp, known.position_m, known.velocity_mps]
    left += [known.parent, known.last_attempt, known.is_known, known.is_granted]
    for phase in views.phases:
        left += [phase.recipient, phase.heard]
    left += [states.position_m, states.velocity_mps, states.is_active]
    left += [costs.age_windows, costs.is_complete, costs.velocity_variance_m2ps2]
    for name, count in sorted(costs.packets._asdict().items()):
        left += [name, count]
    if costs.task_cost is not None:
        left += [costs.task_cost.name, costs.task_cost.unit, costs.task_cost.value]
    return left


def result_rows(comparison: Comparison, folder: Path) -> list[dict[str, str]]:
    """Return the rows of the table that `evaluate` makes of a comparison."""
    import swarm_mj

    usual = {"num_missions": 3, "num_robots": 10, "num_windows": 30}
    fields = {**usual, **comparison.fields}
    path = folder / "results.csv"
    swarm_mj.evaluate(comparison.policies, comparison.task, **fields).save(path)
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def trace_results(comparisons: Iterable[Comparison], folder: Path) -> Traces:
    """Return a trace for each column of the table of results, a step for each row."""
    rows: list[dict[str, str]] = []
    for comparison in comparisons:
        rows += result_rows(comparison, folder)
    traces: Traces = {}
    for column in rows[0]:
        if column in OTHER_COLUMNS:
            continue
        tracer = Tracer()
        for row in rows:
            tracer.add(row[column])
        traces[f"{RESULTS_TASK}: {column}"] = tracer.trace
    return traces


def train(options: str, folder: Path) -> str:
    """Train, and return the trace: a step for each evaluation, and the last for the weights."""
    from safetensors.numpy import load_file

    said = io.StringIO()
    arguments = ["swarm-mj", "train", "--out", str(folder / "run"), *options.split()]
    # Within this process: to import what trains takes longer than to train so little.
    with mock.patch("sys.argv", arguments), redirect_stdout(said), redirect_stderr(said):
        try:
            runpy.run_module("swarm_mj", run_name="__main__")
        except SystemExit as end:
            if end.code:
                raise RuntimeError(f"exit code {end.code}: {said.getvalue()[-300:]}") from end
    tracer = Tracer()
    with (folder / "run" / "curve.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            kept = {name: cell for name, cell in row.items() if name not in OTHER_COLUMNS}
            tracer.add(*(text for cell in sorted(kept.items()) for text in cell))
    weights: list[object] = []
    for name, tensor in sorted(load_file(folder / "run" / "policy.safetensors").items()):
        weights += [name, tensor]
    tracer.add(*weights)
    return tracer.trace


def traces_of(task: str) -> Traces:
    """Do a task by its name; an error is a trace, too, so that it stops no other task."""
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as folder:
        try:
            if task in FLIGHTS:
                return {task: fly(FLIGHTS[task])}
            if task in TRAININGS:
                return {task: train(TRAININGS[task], Path(folder))}
            return trace_results(RESULTS, Path(folder))
        except Exception as error:
            return {task: f"{FAILED}{type(error).__name__}: {error}"}


# Who flies it.


def all_tasks() -> list[str]:
    """Return all tasks, the longest first, so that two cores end at about the same time."""
    return [*TRAININGS, RESULTS_TASK, *FLIGHTS]


def chosen_tasks(patterns: Sequence[str]) -> list[str]:
    """Return the tasks that some pattern names, or all; ValueError for one that names none."""
    if not patterns:
        return all_tasks()
    for pattern in patterns:
        if not fnmatch.filter(all_tasks(), pattern):
            raise ValueError(f"no flight is named {pattern}; --list names all")
    return [task for task in all_tasks() if any(fnmatch.fnmatch(task, p) for p in patterns)]


def do_all(tasks: Sequence[str], jobs: int, console: Console) -> Traces:
    """Do tasks in processes of their own, with a bar; return their traces in the order of tasks."""
    columns = (
        "{task.description}",
        BarColumn(20),
        MofNCompleteColumn(),
        TextColumn("{task.fields[last]}"),
    )
    bar = Progress(*columns, TimeRemainingColumn(), console=console, transient=True)
    bar.disable = not console.is_terminal
    os.environ.update(ONE_THREAD)
    done: dict[str, Traces] = {}
    with tempfile.TemporaryDirectory() as folder:
        write_files(Path(folder))
        # Spawned, so that libraries count their threads anew.
        executor = ProcessPoolExecutor(
            jobs, get_context("spawn"), initializer=os.chdir, initargs=(folder,)
        )
        with executor, bar:
            at_work = bar.add_task("Flying", total=len(tasks), last="")
            # Processes begin here, and inherit that a Ctrl-C is not for them.
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            futures = {executor.submit(traces_of, task): task for task in tasks}
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
            try:
                for future in as_completed(futures):
                    done[futures[future]] = future.result()
                    bar.update(at_work, advance=1, last=futures[future])
            except KeyboardInterrupt:
                for process in active_children():
                    process.kill()  # it writes nothing but into the folder, which goes now
                raise
    traces: Traces = {}
    for task in tasks:
        traces |= done[task]
    return traces


# What is compared.


def is_of(name: str, tasks: Sequence[str]) -> bool:
    """Return whether a trace is one of these tasks'."""
    return name.partition(": ")[0] in tasks


def step_name(name: str, index: int, count: int) -> str:
    """Return what the steps of a trace are called."""
    if name in TRAININGS:
        return "the weights" if index == count - 1 else f"evaluation {index}"
    if name.startswith(f"{RESULTS_TASK}: "):
        policies = [policy for comparison in RESULTS for policy in comparison.policies]
        return f"row {index + 1} ({policies[index]})"
    return f"window {index + 1}"


def difference(name: str, before: str | None, after: str | None) -> str | None:
    """Return how two traces differ, in words; None if they are equal."""
    if before == after:
        return None
    if after is None:
        return "is gone"
    if after.startswith(FAILED) or before is None or before.startswith(FAILED):
        return after if after.startswith(FAILED) else "has no digest to compare with"
    old = before.split()[1]
    new = after.split()[1]
    if len(old) != len(new):
        return f"has {len(new) // 2} steps instead of {len(old) // 2}"
    count = len(new) // 2
    moved = [n for n in range(count) if old[2 * n : 2 * n + 2] != new[2 * n : 2 * n + 2]]
    if not moved:  # one change in 256 leaves a step's two digits as they were
        return "moved, in some step whose digits agree by chance"
    return f"moved first in {step_name(name, moved[0], count)}; {len(moved)} of {count} differ"


def compare(before: Mapping[str, str], after: Mapping[str, str]) -> list[str]:
    """Return a line for each trace that differs."""
    lines = []
    for name in dict.fromkeys([*before, *after]):
        said = difference(name, before.get(name), after.get(name))
        if said is not None:
            lines.append(f"{name} {said}")
    return lines


def machine() -> dict[str, str]:
    """Return what digests depend on beside the code: the processor and the libraries."""
    from llvmlite.binding import get_host_cpu_name

    model = platform.processor() or platform.machine()
    if (cpus := Path("/proc/cpuinfo")).exists():
        for line in cpus.read_text().splitlines():
            if line.startswith("model name"):
                model = line.partition(":")[2].strip()
                break
    found = {"processor": f"{model} ({get_host_cpu_name()})", "system": platform.system()}
    found["python"] = ".".join(platform.python_version_tuple()[:2])
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "none"
    return found


def read(path: Path) -> dict[str, dict[str, str]]:
    """Return a file's machine and traces; ValueError if there is no such file."""
    if not path.exists():
        raise ValueError(f"{path} is not there; write it with --write")
    return json.loads(path.read_text())


def write(path: Path, traces: Mapping[str, str]) -> None:
    """Write traces whole, or not at all."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_text(json.dumps({"machine": machine(), "traces": traces}, indent=1) + "\n")
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def package_of(revision: str) -> Path:
    """Return a folder with the package of a revision; ValueError if there is no such revision."""

    def git(*arguments: str) -> bytes:
        done = subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True)
        if done.returncode:
            raise ValueError(f"git {arguments[0]}: {done.stderr.decode().strip()}")
        return done.stdout

    commit = git("rev-parse", "--verify", f"{revision}^{{commit}}").decode().strip()
    folder = REVISIONS / commit
    if not folder.exists():
        REVISIONS.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(dir=REVISIONS))
        archive = git("archive", commit, "swarm_mj", "assets")
        subprocess.run(["tar", "-x", "-C", str(part)], input=archive, check=True)
        part.replace(folder)
    return folder


def fly_revision(revision: str, options: argparse.Namespace, console: Console) -> Traces:
    """Fly a revision by this tool in a process of its own; return its traces."""
    folder = package_of(revision)
    environment = os.environ | {"PYTHONPATH": str(folder)}
    where = [sys.executable, "-c", "import swarm_mj; print(swarm_mj.__file__)"]
    found = subprocess.run(
        where, env=environment, cwd=folder, capture_output=True, text=True, check=True
    )
    if not Path(found.stdout.strip()).is_relative_to(folder):
        raise ValueError(f"Python takes swarm_mj from {found.stdout.strip()}, not from {folder}")
    console.print(f"Revision {revision}, then the present tree:")
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "revision.json"
        command = [sys.executable, str(Path(__file__).resolve()), "--write", "--golden", str(path)]
        command += ["--jobs", str(options.jobs), "--even-failed"]
        command += ["--only", *options.only] if options.only else []
        code = subprocess.run(command, env=environment).returncode
        if code == INTERRUPTED:
            raise KeyboardInterrupt
        if code:
            raise ValueError(f"revision {revision} could not be flown")
        return read(path)["traces"]


def write_golden(options: argparse.Namespace, tasks: Sequence[str], console: Console) -> int:
    """Fly, and write the digests; those of tasks that are not flown stay."""
    kept: Traces = {}
    if options.only and options.golden.exists():
        stored = read(options.golden)
        if stored["machine"] != machine():
            raise ValueError(f"{options.golden} is another machine's; write it without --only")
        kept = {name: it for name, it in stored["traces"].items() if not is_of(name, tasks)}
    traces = do_all(tasks, options.jobs, console)
    failed = [f"{name} {it}" for name, it in traces.items() if it.startswith(FAILED)]
    if failed and not options.even_failed:
        console.print("\n".join(failed))
        console.print("Nothing was written.")
        return MOVED
    found = kept | traces
    names = [name for task in all_tasks() for name in found if is_of(name, [task])]
    write(options.golden, {name: found[name] for name in names})
    if not options.even_failed:
        console.print(f"{len(traces)} digests written to {options.golden}")
    return EQUAL


def compare_golden(options: argparse.Namespace, tasks: Sequence[str], console: Console) -> int:
    """Fly, compare with a revision or the committed digests, and say what moved."""
    other_machine: list[str] = []
    if options.against:
        before = fly_revision(options.against, options, console)
        what = options.against
    else:
        stored = read(options.golden)
        here = machine()
        before = stored["traces"]
        what = options.golden.name
        for name, value in here.items():
            if stored["machine"].get(name) != value:
                other_machine.append(f"{name} {stored['machine'].get(name)} there, {value} here")
    after = do_all(tasks, options.jobs, console)
    before = {name: trace for name, trace in before.items() if is_of(name, tasks)}
    lines = compare(before, after)
    for line in lines:
        console.print(line)
    console.print(f"{len(after) - len(lines)} of {len(after)} are equal to those of {what}.")
    if other_machine:
        console.print(f"That was written on another machine: {'; '.join(other_machine)}.")
        if lines:
            console.print("So these may differ by rounding; --against REVISION flies both here.")
    return MOVED if lines else EQUAL


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    made = argparse.ArgumentParser(
        description="Prove that flights, results and trainings are equal to the last digit."
    )
    made.add_argument("--write", action="store_true", help="write the digests anew")
    made.add_argument("--against", metavar="REV", help="fly this revision, too, and compare")
    made.add_argument(
        "--only", nargs="+", default=[], metavar="NAME", help="these; * stands for any"
    )
    made.add_argument("--jobs", type=int, default=1, metavar="N", help="processes (default: 1)")
    made.add_argument("--list", action="store_true", help="name all flights")
    made.add_argument("--golden", type=Path, default=GOLDEN, metavar="FILE", help=argparse.SUPPRESS)
    made.add_argument("--even-failed", action="store_true", help=argparse.SUPPRESS)
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Do what the command line says; return the exit code."""
    options = parser().parse_args(arguments)
    console = Console(stderr=True, highlight=False, soft_wrap=True, markup=False)
    if options.list:
        print("\n".join(all_tasks()))
        return EQUAL
    try:
        tasks = chosen_tasks(options.only)
        work: Callable[..., int] = write_golden if options.write else compare_golden
        return work(options, tasks, console)
    except ValueError as error:
        console.print(f"same.py: error: {error}")
        return BAD_INPUT
    except KeyboardInterrupt:
        console.print("interrupted; nothing was written")
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
