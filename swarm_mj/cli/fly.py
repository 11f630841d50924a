"""`swarm-mj fly`: flies one mission, records its replay and says what it cost."""

import argparse
import json
import os
import shlex
import time
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from swarm_mj.cli.flight_table import flight_numbers, flight_table
from swarm_mj.cli.interrupt import deferred_interrupt
from swarm_mj.cli.options import add_mission_options, mission_of, new_parser, this_command
from swarm_mj.cli.outputs import check_writable
from swarm_mj.io.atomic_file import atomic_write
from swarm_mj.io.provenance import commit, version
from swarm_mj.mission import Mission
from swarm_mj.policies.policy import Policy
from swarm_mj.policies.registry import (
    PAYLOADS,
    POLICIES,
    is_directory,
    make_policy,
    normalised,
    with_payload,
)
from swarm_mj.replay.recorder import Recorder
from swarm_mj.replay.view import run as run_viewer
from swarm_mj.replay.view import view_command
from swarm_mj.rollout import WindowRecord, rollout, summarise
from swarm_mj.swarm import Swarm

DONE, INTERRUPTED = 0, 130
REPLAYS = Path("replays")


@dataclass(frozen=True, kw_only=True)
class _Flight:
    """A flight as the command line saw it."""

    policy: Policy
    flown: list[WindowRecord]
    recorder: Recorder | None
    was_interrupted: bool
    wall_s: float


COMPILING_WINDOWS = 10  # in which three robots do all that a flight does, schedules included


def add_parser(commands: Any) -> None:  # noqa: ANN401 - argparse names no public type
    """Adds the command."""
    parser = new_parser(
        commands,
        "fly",
        "Fly one mission and record its replay.",
        epilog="Exit codes: 0 done, 2 bad input, 130 interrupted (what was flown is recorded).",
    )
    parser.add_argument(
        "--policy",
        type=normalised,
        default="planner",
        help=f"who talks to whom: {', '.join(POLICIES)}, or a directory with a learned policy",
    )
    parser.add_argument(
        "--probability",
        type=float,
        default=None,
        help="of a transmission, for policies that have one (default: tuned for the regime)",
    )
    parser.add_argument(
        "--deterministic",
        action="store_true",
        help="a learned policy takes the most probable recipient instead of a draw",
    )
    parser.add_argument(
        "--payload",
        default=PAYLOADS[0],
        help="what the planner's packets carry beyond the buffers T, M and P: "
        f"{', '.join(PAYLOADS)}",
    )
    parser.add_argument("--seed", type=int, default=1, help="the same seed is the same mission")
    add_mission_options(parser)
    group = parser.add_argument_group("output")
    recording = group.add_mutually_exclusive_group()
    recording.add_argument(
        "--record",
        type=Path,
        metavar="FILE.rrd",
        help="the replay (default: a fresh name under replays/)",
    )
    recording.add_argument("--no-record", action="store_true", help="record no replay")
    group.add_argument("--force", action="store_true", help="replace an existing replay")
    group.add_argument(
        "--observer", type=int, default=0, help="the robot whose knowledge the replay shows"
    )
    group.add_argument("--view", action="store_true", help="open the replay afterwards")
    group.add_argument("--json", type=Path, metavar="FILE", help="write a summary")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Runs the command; returns its exit code."""
    (options.policy,) = with_payload([options.policy], options.payload)
    mission = mission_of(options)
    policy = _make_policy(options, mission)
    path = _check_outputs(options)
    console = Console(stderr=True, highlight=False)
    with console.status("Preparing the swarm (compiles once, then it is cached) ..."):
        _compile_ahead(options, mission)
        swarm = Swarm(mission, [options.seed])
        recorder = _recorder(options, swarm, policy) if path else None
    flight = _fly(swarm, policy, recorder, console)
    with deferred_interrupt(), console.status("Writing ..."):
        _write(_config(options, mission, policy), mission, flight, path, options.json)
    _print(options, mission, flight, path)
    if flight.was_interrupted:
        console.print(f"Interrupted after {len(flight.flown)} of {mission.num_windows} windows.")
        return INTERRUPTED
    return run_viewer(view_command(path)) if options.view and path else DONE


def _make_policy(options: argparse.Namespace, mission: Mission) -> Policy:
    return make_policy(
        options.policy, mission, options.probability, is_deterministic=options.deterministic
    )


def _check_outputs(options: argparse.Namespace) -> Path | None:
    """The replay's path, or None; raises ValueError for what could not be written later."""
    if options.json:
        check_writable(options.json, "summary")
    if options.no_record:
        if options.view:
            raise ValueError("--view needs a replay; leave out --no-record")
        return None
    path = options.record or _fresh_name(options)
    if path.suffix != ".rrd":
        raise ValueError(f"replay must be named *.rrd, not {path}")
    check_writable(path, "replay", must_be_new=not options.force)
    if options.json and options.json.resolve() == path.resolve():
        raise ValueError(f"--record and --json name the same file, {path}")
    if options.view:
        view_command(path)  # complains now if there is no display
    return path


def _fresh_name(options: argparse.Namespace) -> Path:
    """A name of this process's own, for flights that start in the same second."""
    when = f"{datetime.now():%Y%m%d-%H%M%S}-{os.getpid()}"
    return REPLAYS / f"{options.task}-{_short(options.policy)}-seed{options.seed}-{when}.rrd"


def _short(policy: str) -> str:
    """A policy's name without the path: `x` of runs/x/policy."""
    if not is_directory(policy):
        return policy.replace(" --", "-").replace(" ", "-")
    path = Path(policy).resolve()
    return path.parent.name if path.name == "policy" else path.name


def _compile_ahead(options: argparse.Namespace, mission: Mission) -> None:
    """Flies such a mission in small, with both its halves, so that compiling is not timed."""
    smallest = replace(mission, num_robots=3, range_ratio=10.0, num_windows=COMPILING_WINDOWS)
    for _ in rollout(Swarm(smallest, [0]), _make_policy(options, smallest)):
        pass


def _recorder(options: argparse.Namespace, swarm: Swarm, policy: Policy) -> Recorder:
    return Recorder(
        swarm, ego=options.observer, is_broadcast=policy.window(swarm.mission).is_broadcast
    )


def _fly(swarm: Swarm, policy: Policy, recorder: Recorder | None, console: Console) -> _Flight:
    """Flies with a progress bar; Ctrl-C ends the flight after a whole window."""
    flown: list[WindowRecord] = []
    bar = Progress(
        TextColumn("Flying"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("windows, age {task.fields[age]:.1f}"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
    )
    start_s = time.perf_counter()
    with deferred_interrupt() as is_interrupted, bar:
        task = bar.add_task("fly", total=swarm.mission.num_windows, age=0.0)
        for window in rollout(swarm, policy):
            flown.append(window)
            if recorder:
                recorder.add(window)
            bar.update(task, advance=1, age=float(window.costs.age_windows[0]))
            if is_interrupted():
                break
        was_interrupted = is_interrupted() and len(flown) < swarm.mission.num_windows
    wall_s = time.perf_counter() - start_s
    return _Flight(
        policy=policy,
        flown=flown,
        recorder=recorder,
        was_interrupted=was_interrupted,
        wall_s=wall_s,
    )


def _config(options: argparse.Namespace, mission: Mission, policy: Policy) -> dict[str, Any]:
    """Everything that makes this flight again."""
    return {
        **asdict(mission),
        "policy": options.policy,
        **policy.parameters,
        "seed": options.seed,
        "observer": options.observer,
        "version": version(),
        "commit": commit(),
    }


def _write(
    config: dict[str, Any], mission: Mission, flight: _Flight, path: Path | None, json_: Path | None
) -> None:
    """Writes the replay and the summary."""
    if path and flight.recorder:
        from swarm_mj.replay.write import write_replay  # rerun takes its time to import

        kept = {key: value for key, value in config.items() if value is not None}
        write_replay(flight.recorder.log(), mission, kept, path)
    if json_:
        document = {
            "config": config,
            **flight_numbers(flight.policy, summarise(flight.flown)),
            "wall_seconds": flight.wall_s,
            "interrupted": flight.was_interrupted,
            "replay": str(path) if path else None,
        }
        with atomic_write(json_) as part:
            part.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")


def _print(
    options: argparse.Namespace, mission: Mission, flight: _Flight, path: Path | None
) -> None:
    """Prints the table and how to open the replay."""
    console = Console(highlight=False, soft_wrap=True, markup=False)
    team = f"{mission.num_robots} robots"
    if mission.switched_off:
        team += f", {mission.switched_off:.0%} of them off half-way"
    title = f"{mission.task}, {options.policy}, {team}, seed {options.seed}"
    summary = summarise(flight.flown)
    console.print(flight_table(mission, flight.policy, summary, flight.wall_s, title=title))
    if path:
        console.print(f"Open the replay:  {this_command()} replay {shlex.quote(str(path))}")
