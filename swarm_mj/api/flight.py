"""One flight, as `swarm_mj.fly` and `swarm-mj fly` share it: what flies, and how it ends.

A flight ends early without loss: Ctrl-C ends it after a whole window, and so does a lack of memory
while there is enough to write the windows flown.
"""

import gc
import math
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np
from rich.console import Console

from swarm_mj.api.flight_summary import FlightSummary
from swarm_mj.api.flight_table import flight_numbers, plain_number
from swarm_mj.api.run import Run
from swarm_mj.mission import Mission
from swarm_mj.mission.bodies import POINT
from swarm_mj.mission.geometry import count_strayed
from swarm_mj.physics.arenas import ARENAS
from swarm_mj.physics.robots import SHIPPED
from swarm_mj.policies import registry
from swarm_mj.policies.policy import Policy
from swarm_mj.policies.policy_arguments import USUAL, PolicyArguments
from swarm_mj.replay.recorder import Recorder, check_observer
from swarm_mj.replay.replay_size import IN_MEMORY, ON_DISK
from swarm_mj.simulation.components import Components
from swarm_mj.simulation.memory import FLYING, LIBRARIES, memory_growth, policy_memory
from swarm_mj.simulation.rollout import WindowRecord, rollout, summarise
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.compiled import compiling
from swarm_mj.system.exit_codes import DONE, FAILED, INTERRUPTED
from swarm_mj.system.interrupt import deferred_interrupt
from swarm_mj.system.needs import Needs, free_memory, in_gb, memory_errors
from swarm_mj.system.packages import commit, version
from swarm_mj.system.terminal import WorkBar

BETWEEN_LOOKS_BYTES = 4e6  # recorded; a look at the free memory takes half a millisecond
LONGEST_SLEEP_S = 0.05  # after which a flight that waits hears of Ctrl-C
COMPILING_WINDOWS = 10  # in which three robots use all that a flight does, schedules included
SECOND_LOOK_S = 0.5  # memory that others have just freed may still be counted for so long


@dataclass(frozen=True, kw_only=True)
class Flight:
    """A mission, and all that flies it."""

    mission: Mission
    policy: Policy
    policy_name: str  # of which the registry made the policy; of a user's own object, its class's
    arguments: PolicyArguments = USUAL  # with which it was made
    components: Components = Components()
    seed: int
    observer: int = 0  # the robot whose knowledge the replay shows
    speed: float = math.inf  # times as fast as the mission's own time, at most
    is_recorded: bool = True

    def config(self) -> dict[str, Any]:
        """Return all that the flight depends on, for replays and summaries."""
        return {
            **asdict(self.mission),
            "policy": self.policy_name,
            **self.policy.parameters,
            "packet_bytes": self.policy.packet(self.mission).num_bytes,
            "seed": int(self.seed),  # NumPy's numbers are no JSON
            "observer": int(self.observer),
            "version": version(),
            "commit": commit(),
            **self.components.names,
        }


@runtime_checkable
class LiveShow(Protocol):
    """An object that shows a flight while it goes on: `swarm_mj.replay.live.LiveReplay`."""

    def show(self) -> None:
        """Show what was flown, after every window."""
        ...

    def finish(self) -> None:
        """Show the rest, after the last one."""
        ...


# Makes it, of a recorder and the flight's configuration.
Shows: TypeAlias = Callable[[Recorder, Mapping[str, Any]], LiveShow]


class FinishedFlight(NamedTuple):
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


def fly_mission(
    flight: Flight, *, console: Console, way_on: str | None, shows: Shows | None = None
) -> FinishedFlight:
    """Fly a mission from the first window to the last.

    Args:
        flight: What flies.
        console: Where a bar shows how far it is.
        way_on: The end of the message that memory ran short; None flies on regardless.
        shows: Makes what shows the flight while it goes on; the flight must be recorded.

    Raises:
        MemoryError: Memory did not suffice for one window.
        ValueError: As of `Swarm` and `rollout`; the observer is no robot, or features were named
            that the policy has not.
    """
    mission = flight.mission
    check_observer(flight.observer, mission.num_robots)
    arguments = flight.arguments
    registry.check_used(arguments.features, arguments.networks, [flight.policy])
    with console.status("Preparing the swarm ...") as status, compiling(status.update):
        swarm = Swarm(mission, [flight.seed], **flight.components.given)
        swarm.start(flight.policy)
        recorder = Recorder(swarm, ego=flight.observer) if flight.is_recorded else None
        compile_ahead(mission, flight.policy_name, flight.arguments)
        shown = shows(recorder, flight.config()) if shows and recorder else None
    bar = WorkBar("Flying", mission.num_windows, "windows", console=console)
    watch = _watch(flight, bar, recorder, shown, looks=way_on is not None)
    start_s = time.perf_counter()
    windows, code, ending = _fly_windows(swarm, watch, way_on)
    wall_s = time.perf_counter() - start_s
    if shown:
        with console.status("Showing the rest ..."):
            shown.finish()

    numbers = flight_numbers(mission, flight.policy, summarise(windows))
    numbers["wall_seconds"] = wall_s
    numbers["interrupted"] = code != DONE
    numbers["heard_share"] = _heard_share(swarm)
    numbers["strayed"] = _num_strayed(swarm)
    states = swarm.states
    numbers["crashed"] = plain_number(states.num_crashed, is_count=True)
    numbers["energy_mean_j"] = plain_number(states.mean_energy_j)
    numbers["energy_worst_j"] = plain_number(states.most_energy_j)
    run = Run(
        mission=mission,
        config=flight.config(),
        summary=FlightSummary(**numbers),
        windows=tuple(windows),
    )
    if ending:
        ending += f" after {len(windows)} of {mission.num_windows} windows"
    return FinishedFlight(run=run, recorder=recorder, code=code, ending=ending)


class _Watch(NamedTuple):
    """Records and shows a flight, window by window, and holds it back to its speed."""

    bar: WorkBar
    recorder: Recorder | None
    shown: LiveShow | None
    window_s: float  # that each window takes at least: a live flight may be slowed down
    windows_between_looks: int  # at the free memory; 0 never looks

    def see(self, window: WindowRecord) -> None:
        """Record and show a window that was flown."""
        if self.recorder:
            self.recorder.add(window)
        self.bar.text = f"age {float(window.costs.age_windows[0]):.1f}"
        self.bar.advance()
        if self.shown:
            self.shown.show()

    def wait(self, start_s: float, num_windows: int, is_interrupted: Callable[[], bool]) -> None:
        """Wait until the next window is due, after those flown; Ctrl-C ends that, too."""
        if self.window_s == 0.0:
            return
        until_s = start_s + num_windows * self.window_s
        while not is_interrupted() and time.perf_counter() < until_s:
            time.sleep(min(LONGEST_SLEEP_S, max(0.0, until_s - time.perf_counter())))

    def shortage(self, mission: Mission, num_windows: int) -> str | None:
        """Return a message if it is time to look at the memory, and it is short."""
        every = self.windows_between_looks
        if self.recorder is None or every == 0 or num_windows % every != 0:
            return None
        return _shortage(mission, num_windows, self.recorder)


def _watch(
    flight: Flight, bar: WorkBar, recorder: Recorder | None, shown: LiveShow | None, *, looks: bool
) -> _Watch:
    """Return what goes on after each window; it looks at the memory if it is to."""
    between = 0
    if recorder and looks:
        between = max(1, int(BETWEEN_LOOKS_BYTES / recorder.window_bytes))
    window_s = flight.mission.window_s / flight.speed
    return _Watch(
        bar=bar,
        recorder=recorder,
        shown=shown,
        window_s=window_s,
        windows_between_looks=between,
    )


def _fly_windows(
    swarm: Swarm, watch: _Watch, way_on: str | None
) -> tuple[list[WindowRecord], int, str]:
    """Return the windows flown, an exit code and why they are not all; MemoryError if none."""
    flown: list[WindowRecord] = []
    # Unless it ends otherwise, below.
    code = FAILED
    ending = "Out of memory"
    start_s = time.perf_counter()
    with suppress(MemoryError), memory_errors(), deferred_interrupt() as is_interrupted, watch.bar:
        for window in rollout(swarm):
            watch.see(window)
            flown.append(window)
            watch.wait(start_s, len(flown), is_interrupted)
            if is_interrupted():
                code = INTERRUPTED
                ending = "Interrupted"
                break
            short = watch.shortage(swarm.mission, len(flown))
            if short:
                ending = f"Memory ran short ({short}{way_on})"
                break
        else:
            code = DONE
            ending = ""
    if not flown:
        raise MemoryError
    return flown, code, ending


def _heard_share(swarm: Swarm) -> float:
    """Return the share of the pairs of active robots of which the first has heard of the second."""
    is_known = swarm.buffers.is_known[0]
    if swarm.states.is_active is not None:
        is_on = swarm.states.is_active[0]
        is_known = is_known[is_on][:, is_on]
    own = len(is_known)  # a robot knows itself
    return float((np.sum(is_known) - own) / (is_known.size - own))


def _num_strayed(swarm: Swarm) -> int:
    """Return how many active robots have no other within the mission's range."""
    states = swarm.states
    return int(count_strayed(states.position_m, swarm.mission.range_m, states.is_active)[0])


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


def flight_needs(mission: Mission, policy: str, *, is_recorded: bool) -> Needs:
    """Return the memory and disk that a flight takes."""
    memory = policy_memory(policy, mission) + (FLYING - LIBRARIES)
    grows = memory_growth(policy, mission)
    if not is_recorded:
        return Needs(memory=memory, grows=grows)
    num = mission.num_windows
    memory += IN_MEMORY.of(mission, num)
    return Needs(memory=memory, file=ON_DISK.of(mission, num), grows=grows)


def compile_ahead(mission: Mission, policy_name: str, arguments: PolicyArguments = USUAL) -> None:
    """Fly a small mission of this kind, beyond half-way, so that compiling is not timed."""
    # A stored policy may be for teams of one size, and a file's arena does not shrink.
    is_bound = registry.is_stored(policy_name) or mission.arena not in ARENAS
    robots = mission.num_robots if is_bound else 3
    kind = mission.groups[0].kind
    smallest = replace(
        mission,
        num_robots=robots,
        robot=kind if kind in SHIPPED else POINT,  # a file may need a pilot of its own
        range_ratio=10.0,
        num_windows=COMPILING_WINDOWS,
    )
    if policy_name in registry.POLICIES or registry.is_stored(policy_name):
        policy = registry.make_policy_with(arguments, policy_name, smallest)
    else:
        # A user's own may be made for one mission only, or be an object, which flies only once.
        policy = registry.make_policy("tdma", smallest)
    summarise(rollout(Swarm(smallest, [0]), policy))
