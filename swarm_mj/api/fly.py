"""`swarm_mj.fly`, one mission from Python, and the flight that `swarm-mj fly` shares with it.

A flight ends early without loss: Ctrl-C ends it after a whole window, and so does a lack of memory
while there is enough to write the windows flown.
"""

import gc
import inspect
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console

from swarm_mj.api.flight_table import flight_numbers
from swarm_mj.api.run import Metrics, Run
from swarm_mj.control.motion import Controller
from swarm_mj.mission import Mission, make_mission
from swarm_mj.mission.components import Components
from swarm_mj.physics.arenas import ARENAS
from swarm_mj.physics.scene import Scene
from swarm_mj.policies import registry
from swarm_mj.policies.policy import Policy
from swarm_mj.radio.free_space import Channel
from swarm_mj.replay.recorder import IN_MEMORY, ON_DISK, Recorder, check_observer
from swarm_mj.simulation.rollout import WindowRecord, rollout, summarise
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system import needs
from swarm_mj.system.compiled import compiling
from swarm_mj.system.exit_codes import DONE, FAILED, INTERRUPTED
from swarm_mj.system.fields import check_kind, check_names, former_names
from swarm_mj.system.interrupt import deferred_interrupt
from swarm_mj.system.needs import Needs, check_fits, free_memory, in_gb, memory_errors
from swarm_mj.system.packages import commit, version
from swarm_mj.system.terminal import WorkBar, quiet_console

WINDOWS_BETWEEN_LOOKS = 50  # at the free memory
COMPILING_WINDOWS = 10  # in which three robots use all that a flight does, schedules included
SECOND_LOOK_S = 0.5  # memory that others have just freed may still be counted for so long


class Flown(NamedTuple):
    """A mission flown, its record if there is one, and how the flight ended."""

    run: Run  # whose log is not made yet
    recorder: Recorder | None
    code: int  # an exit code
    ending: str  # why it ended early, and when; empty if it did not

    @property
    def recorded(self) -> Run:
        """The run with its log, if it was recorded."""
        run = self.run
        return replace(run, log=self.recorder.log(run.config)) if self.recorder else run


def fly(
    task: str | Mission | None = None,
    *,
    policy: str | Path | Policy = "planner",
    seed: int = 1,
    probability: float | None = None,
    is_deterministic: bool = False,
    record: bool = True,
    observer: int = 0,
    channel: str | Channel | None = None,
    controller: str | Controller | None = None,
    scene: str | Scene | None = None,
    features: str | Sequence[str] = (),
    **mission_fields: Any,
) -> Run:
    """Fly one mission, from the first window to the last.

    The same arguments give the same numbers as `swarm-mj fly` does. On a terminal, a bar shows how
    far it is. Ctrl-C ends the flight after a whole window and keeps what was flown; before the
    first window it raises KeyboardInterrupt. Raises ValueError if a value is unknown or out of
    range, or memory does not suffice; TypeError if an argument is of the wrong kind, or unknown.

    Args:
        task: The robots' task by name, or a `Mission`. None is "flocking", and "random-walk" in the
            presets "indoor", "urban" and "open-field".
        policy: Who transmits when: a name of `POLICIES`, the folder of a learned one, an object, or
            `module:Name` of your own.
        seed: The same seed is the same mission.
        probability: Of a transmission, for the named policies that have one; tuned unless given.
        is_deterministic: Whether a learned policy takes its most probable recipient, not a draw.
        record: Whether to keep the data of replays and videos, which takes memory.
        observer: The robot whose knowledge the replay shows.
        channel: Who decodes whom, as an object or `module:Name`; the mission's radio unless given.
        controller: What drives the robots, likewise; that of the task unless given.
        scene: A function that adds obstacles to the arena, likewise; none unless given.
        features: Names of your own feature extractors that a learned policy was trained with.
        **mission_fields: Any field of `Mission`, such as `num_robots=20` or `preset="reference"`.
    """
    mission = mission_of(fly, task, mission_fields)
    how = {"probability": probability, "is_deterministic": is_deterministic}
    how |= {"features": (features,) if isinstance(features, str) else tuple(features)}
    chosen, name = _policy_of(policy, mission, how)
    components = Components(channel=channel, controller=controller, scene=scene)
    way_out = "choose fewer num_robots or num_windows" + (", or record=False" if record else "")
    needed = flight_needs(mission, name, is_recorded=record)
    check_fits(needed, None, way_out, is_forced=False, way_on="")
    flown = fly_mission(
        mission,
        chosen,
        name,
        how,
        components,
        seed=seed,
        observer=observer,
        is_recorded=record,
        console=quiet_console(),
        way_on="",
    )
    if flown.ending:
        warnings.warn(f"{flown.ending}; these are kept", stacklevel=2)
    return flown.recorded


def mission_of(
    function: Callable[..., Any], task: str | Mission | None, mission_fields: Mapping[str, Any]
) -> Mission:
    """Return the mission that a function's arguments name; TypeError for fields it cannot have."""
    parameters = inspect.signature(function).parameters.values()
    keywords = [each.name for each in parameters if each.kind is each.KEYWORD_ONLY]
    names = [spec.name for spec in fields(Mission) if spec.name != "task"]
    known = [*names, *keywords]
    check_names(f"swarm_mj.{function.__name__}", mission_fields, known, former_names(Mission))
    if isinstance(task, Mission) and mission_fields:
        given = ", ".join(f"{name}={value!r}" for name, value in mission_fields.items())
        rule = f"you gave a finished mission, so {', '.join(mission_fields)} must be part of it"
        raise TypeError(f"{rule}: dataclasses.replace(mission, {given})")
    return make_mission(task, **mission_fields)


def flight_needs(mission: Mission, policy: str, *, is_recorded: bool) -> Needs:
    """Return the memory and disk that a flight takes."""
    memory = registry.missions_memory(policy, mission) + (needs.FLYING - needs.LIBRARIES)
    if not is_recorded:
        return Needs(memory=memory)
    num = mission.num_windows
    return Needs(memory=memory + IN_MEMORY.of(mission, num), file=ON_DISK.of(mission, num))


def fly_mission(
    mission: Mission,
    policy: Policy,
    name: str,
    how: Mapping[str, Any],
    components: Components,
    *,
    seed: int,
    observer: int,
    is_recorded: bool,
    console: Console,
    way_on: str | None,
) -> Flown:
    """Fly a mission from the first window to the last, with a bar on the console.

    The policy is what `make_policy` makes of its name and `how`, or a user's own. `way_on` ends
    the message that memory ran short; None flies on regardless. Raises MemoryError if memory did
    not suffice for one window, and ValueError as `Swarm` and `rollout` do.
    """
    check_observer(observer, mission.num_robots)
    registry.check_used(how["features"], [policy])
    with console.status("Preparing the swarm ...") as status, compiling(status.update):
        swarm = Swarm(mission, [seed], **components.given)
        swarm.start(policy)
        recorder = Recorder(swarm, ego=observer) if is_recorded else None
        compile_ahead(mission, name, **how)
    bar = WorkBar("Flying", mission.num_windows, "windows", console=console)
    start_s = time.perf_counter()
    windows, code, ending = _fly_windows(swarm, recorder, bar, way_on)
    wall_s = time.perf_counter() - start_s
    config = {
        **asdict(mission),
        "policy": name,
        **policy.parameters,
        "packet_bytes": policy.packet(mission).num_bytes,
        "seed": int(seed),  # NumPy's numbers are no JSON
        "observer": int(observer),
        "version": version(),
        "commit": commit(),
        **components.names,
    }
    numbers = flight_numbers(mission, policy, summarise(windows))
    numbers |= {"wall_seconds": wall_s, "interrupted": code != DONE}
    numbers["heard_share"] = _heard_share(swarm)
    run = Run(mission=mission, config=config, summary=Metrics(numbers), windows=tuple(windows))
    when = f"{ending} after {len(windows)} of {mission.num_windows} windows" if ending else ""
    return Flown(run=run, recorder=recorder, code=code, ending=when)


def _heard_share(swarm: Swarm) -> float:
    """Return the share of the pairs of active robots of which the first has heard of the second."""
    is_on = swarm.states.is_active
    on = slice(None) if is_on is None else is_on[0]
    is_known = swarm.buffers.is_known[0][on][:, on]
    own = len(is_known)  # a robot knows itself
    return float((np.sum(is_known) - own) / (is_known.size - own))


def _fly_windows(
    swarm: Swarm, recorder: Recorder | None, bar: WorkBar, way_on: str | None
) -> tuple[list[WindowRecord], int, str]:
    """Return the windows flown, an exit code and why they are not all; MemoryError if none."""
    flown: list[WindowRecord] = []
    code, ending = FAILED, "Out of memory"  # unless it ends otherwise, below
    with suppress(MemoryError), memory_errors(), deferred_interrupt() as is_interrupted, bar:
        for window in rollout(swarm):
            if recorder:
                recorder.add(window)
            flown.append(window)
            bar.text = f"age {float(window.costs.age_windows[0]):.1f}"
            bar.advance()
            if is_interrupted():
                code, ending = INTERRUPTED, "Interrupted"
                break
            is_time = way_on is not None and len(flown) % WINDOWS_BETWEEN_LOOKS == 0
            if recorder and is_time and (short := _shortage(swarm.mission, len(flown), recorder)):
                ending = f"Memory ran short ({short}{way_on})"
                break
        else:
            code, ending = DONE, ""
    if not flown:
        raise MemoryError
    return flown, code, ending


def compile_ahead(mission: Mission, policy_name: str, **how: Any) -> None:
    """Fly a small mission of this kind, beyond half-way, so that compiling is not timed."""
    # A stored policy may be for teams of one size, and a file's arena does not shrink.
    is_bound = registry.is_stored(policy_name) or mission.arena not in ARENAS
    robots = mission.num_robots if is_bound else 3
    smallest = replace(mission, num_robots=robots, range_ratio=10.0, num_windows=COMPILING_WINDOWS)
    # A user's own policy may be made for one mission only, or be an object, which flies only once.
    if not (policy_name in registry.POLICIES or registry.is_stored(policy_name)):
        policy_name, how = "tdma", {}
    policy = registry.make_policy(policy_name, smallest, **how)
    summarise(rollout(Swarm(smallest, [0]), policy))


def _policy_of(
    policy: str | Path | Policy, mission: Mission, how: Mapping[str, Any]
) -> tuple[Policy, str]:
    """Return a policy and its name: what was given, or its class's."""
    if not isinstance(policy, Policy):
        check_kind("policy", policy, (str, Path), '"planner"')
        name = registry.flown_name(str(policy), mission)
        return registry.make_policy(name, mission, **how), name
    if how["probability"] is not None or how["is_deterministic"]:
        raise TypeError(
            "probability and is_deterministic change policies by name; make it with them"
        )
    return policy, type(policy).__name__


def _shortage(mission: Mission, num_windows: int, recorder: Recorder) -> str | None:
    """Return a message if memory does not suffice to write the replay, at a second look either."""
    needed = IN_MEMORY.of(mission, num_windows) - recorder.num_bytes
    if free_memory() >= needed:
        return None
    gc.collect()
    time.sleep(SECOND_LOOK_S)
    free = free_memory()
    short = f"{in_gb(free)} are free, writing the replay takes {in_gb(needed)}"
    return short if free < needed else None
