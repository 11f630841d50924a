"""`swarm-mj fly`: flies one mission, records its replay and says what it cost."""

import math
import os
import shlex
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import ClassVar

from rich.console import Console

from swarm_mj.api.flight import Flight, flight_needs, fly_mission
from swarm_mj.api.live import (
    LiveFlight,
    check_live,
    keep_open,
    live_option,
    open_viewer,
    speed_option,
)
from swarm_mj.cli.mission_options import NAMES, PolicyOptions, mission_flags, one_mission
from swarm_mj.cli.options import common_output, output_option
from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import MAX_SEED
from swarm_mj.physics.arenas import notes_on
from swarm_mj.policies import registry
from swarm_mj.policies.policy_config import SUFFIX
from swarm_mj.replay import view
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import common_setting, files_read
from swarm_mj.system.interrupt import deferred_interrupt
from swarm_mj.system.needs import YES, check_fits
from swarm_mj.system.packages import is_installed, missing, need
from swarm_mj.system.terminal import plain_console, say_written, this_command
from swarm_mj.system.writing import Output, check_outputs, write_json

REPLAYS = Path("replays")
OTHERWISE = "name another place with --record, or leave it out with --no-record"
LARGE = 80  # robots, beyond which a plan takes long, and age-gain-csma has the lower age


@dataclass(frozen=True, kw_only=True)
class FlyOptions(PolicyOptions):
    """The options of `swarm-mj fly`."""

    EPILOG: ClassVar = (
        "Exit codes: 0 done, 1 the machine failed, 2 bad input, 130 interrupted (what was flown is "
        "recorded)."
    )
    policy: str = common_setting(
        "planner",
        f"{NAMES}, a learned policy's directory or file, or module:Name of your own",
        reads=registry.files_of,
        one_only="fly flies one policy, and `swarm-mj evaluate` compares several",
    )
    seed: int = common_setting(1, "the same seed is the same mission", low=0, high=MAX_SEED)
    mission: Mission = one_mission()
    record: Path | None = common_output(
        None,
        "the replay",
        metavar="FILE.rrd",
        shown=f"a fresh name under {REPLAYS}/",
        sought_as=("--out",),
    )
    no_record: bool = common_output(False, "record no replay")
    json: Path | None = common_output(None, "write a summary")
    force: bool = output_option(False, "replace existing files")
    yes: bool = output_option(False, YES)
    observer: int = output_option(0, "the robot whose knowledge the replay shows")
    view: bool = common_output(False, "open the replay afterwards")
    live: str | None = live_option(
        help="show the mission while it flies, in rerun's viewer or, with web, in a browser"
    )
    speed: float | None = speed_option()


def run(options: FlyOptions) -> int:
    """Run the command; return its exit code."""
    mission = options.mission
    (asked,) = registry.with_payload([options.policy], options.payload)
    options = replace(options, policy=registry.flown_name(asked, mission))
    if path := _replay_path(options):
        need("rerun", "a replay", "fly without one: --no-record")
    check_live(options.live, options.speed)
    _check_memory(options, path)
    console = Console(stderr=True, highlight=False)
    note = registry.note_on(asked, mission)
    flown_as = [note] if note else []
    if options.live is None:
        return _fly(options, path, console, flown_as)
    with open_viewer(options.live, console) as viewer:
        name = path.stem if path else "live"
        live = LiveFlight(viewer, name, has_file=path is not None, speed=options.speed)
        code = _fly(options, path, console, flown_as, live)
        return keep_open(viewer) if code == DONE else code


def _fly(
    options: FlyOptions,
    path: Path | None,
    console: Console,
    flown_as: Sequence[str],  # what is to be said of the policy, if it flies as another
    live: LiveFlight | None = None,
) -> int:
    """Fly, write and say what was flown; return the exit code."""
    way_on = None if options.yes else "; --yes flies on all the same"
    flight = _flight(options, is_recorded=path is not None or live is not None)
    shows = live.begin if live else None
    flown = fly_mission(flight, console=console, way_on=way_on, shows=shows)
    # After the flight: an arena that does not compile is refused there.
    for note in (*flown_as, *notes_on(options.mission)):
        console.print(note)
    with deferred_interrupt(), ExitStack() as stack:
        # The stack unwinds in reverse: the replay is written even if the summary fails, and the
        # table is printed in any case.
        stack.callback(lambda: plain_console().print(flown.run.table()))
        stack.enter_context(console.status("Writing ..."))
        if path and live:
            stack.callback(live.save, path)
        elif path:
            stack.callback(lambda: flown.recorded.save(path))
        if options.json:
            write_json(options.json, flown.run.report(path))
    if options.json:
        say_written(options.json)
    for label, line in _next_commands(options, path):
        plain_console().print(f"{label:18}{line}")
    if flown.ending:
        console.print(f"{flown.ending}.")
        return flown.code
    is_to_view = options.view and live is None  # which shows it already
    return view.run(view.view_command(path)) if is_to_view and path else DONE


def _check_memory(options: FlyOptions, path: Path | None) -> None:
    """Raise ValueError if the flight takes more than there is, unless the user insists."""
    way_out = "choose fewer --robots or --windows"
    if path:
        way_out += ", or --no-record"
    needs = flight_needs(options.mission, options.policy, is_recorded=path is not None)
    check_fits(needs, path, way_out, is_forced=options.yes)


def _flight(options: FlyOptions, *, is_recorded: bool) -> Flight:
    """Return what the options fly."""
    return Flight(
        mission=options.mission,
        policy=registry.make_policy_with(options.arguments, options.policy, options.mission),
        policy_name=options.policy,
        arguments=options.arguments,
        components=options.components,
        seed=options.seed,
        observer=options.observer,
        is_recorded=is_recorded,
        speed=math.inf if options.speed is None else options.speed,
    )


def _next_commands(options: FlyOptions, path: Path | None) -> Iterator[tuple[str, str]]:
    """Yield what to do next, and the commands that do it."""
    name = this_command()
    way = "" if view.has_display() else "--web "
    if path:
        yield "Open the replay:", f"{name} replay {way}{shlex.quote(str(path))}"
    yield "Other policies:", f"{name} policies"
    policies = [options.policy]
    best = "age-gain-csma" if options.mission.num_robots > LARGE else "planner"
    for other in (best, "tdma", "random-flooding"):
        with suppress(ValueError):  # its packets are larger than a slot
            registry.make_policy(other, options.mission)
            policies.append(other)
    parts = [f"--{kind} {shlex.quote(part)}" for kind, part in options.names.items()]
    if options.features:
        parts.append(f"--features {shlex.join(options.features)}")
    if options.networks:
        parts.append(f"--network {shlex.join(options.networks)}")
    named = shlex.join(dict.fromkeys(policies))
    flags = " ".join((mission_flags(options.mission), *parts))
    yield "Compare some:", f"{name} evaluate --policy {named} --episodes 5 {flags}"


def _replay_path(options: FlyOptions) -> Path | None:
    """Return the replay's path, or None; raise ValueError if it could not be written later."""
    if options.no_record and options.record:
        raise ValueError("--no-record is not allowed with --record; leave one out")
    if options.no_record and options.view:
        raise ValueError("--view needs a replay; leave out --no-record")
    if options.no_record and options.observer:
        raise ValueError("--observer is whose knowledge a replay shows; leave out --no-record")
    is_chosen = options.no_record or options.record or options.view
    if not (is_chosen or is_installed("rerun")):
        plain_console(is_error=True).print(missing("rerun", "no replay is recorded: it"))
        options = replace(options, no_record=True)
    if options.no_record:
        replay = Output("the replay", None, ".rrd")
    elif options.record:
        replay = Output("--record", options.record, ".rrd")
    else:
        replay = Output("the replay", _fresh_name(options), ".rrd", OTHERWISE)
    check_outputs(
        replay,
        Output("--json", options.json, ".json"),
        inputs=files_read(options),
        must_be_new=not options.force,
    )
    if options.view and replay.path:
        view.view_command(replay.path)  # complains now if there is no display
    return replay.path


def _fresh_name(options: FlyOptions) -> Path:
    """Return a name of this process's own, for flights that start in the same second."""
    policy = options.policy.replace(" --", "-").replace(" ", "-").replace(":", "-")
    if registry.is_stored(options.policy):
        path = Path(options.policy.removesuffix(SUFFIX)).resolve()
        policy = path.parent.name if path.name == "policy" else path.name  # x of runs/x
    when = f"{datetime.now():%Y%m%d-%H%M%S}-{os.getpid()}"
    return REPLAYS / f"{options.mission.task}-{policy}-seed{options.seed}-{when}.rrd"
