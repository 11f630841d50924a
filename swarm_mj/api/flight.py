"""The flight itself, of `swarm-mj fly` and of `swarm_mj.fly` alike: it ends early without loss.

Ctrl-C ends it after a whole window, and so does a lack of memory while there is enough to write
the windows flown.
"""

import gc
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, replace
from typing import Any, NamedTuple

from swarm_mj.api.flight_table import flight_numbers
from swarm_mj.api.run import Metrics, Run
from swarm_mj.mission import Mission
from swarm_mj.mission.components import Components
from swarm_mj.physics.arenas import ARENAS
from swarm_mj.policies.registry import is_learned, is_own_policy, is_stored, make_policy
from swarm_mj.replay.recorder import Recorder, replay_file, replay_memory
from swarm_mj.simulation.rollout import WindowRecord, rollout, summarise
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system import needs
from swarm_mj.system.exit_codes import DONE, FAILED, INTERRUPTED
from swarm_mj.system.interrupt import deferred_interrupt
from swarm_mj.system.needs import Needs, free_memory, in_gb, memory_errors
from swarm_mj.system.progress import WorkBar
from swarm_mj.system.provenance import commit, version

WINDOWS_BETWEEN_LOOKS = 50  # at the free memory
COMPILING_WINDOWS = 10  # in which three robots use all that a flight does, schedules included
SECOND_LOOK_S = 0.5  # memory that others have just freed may still be counted for so long


class Flown(NamedTuple):
    """The windows flown, and how the flight ended."""

    windows: list[WindowRecord]
    code: int  # an exit code
    ending: str  # why it ended early; empty if it did not
    wall_s: float


def flight_needs(mission: Mission, policy: str, *, is_recorded: bool) -> Needs:
    """Return the memory and disk that a flight takes."""
    memory = needs.missions_memory(mission.num_robots, 1, is_learned=is_learned(policy))
    addresses = needs.ADDRESSES + (needs.OF_TORCH if is_learned(policy) else 0.0)
    if not is_recorded:
        return Needs(memory=memory, addresses=addresses)
    return Needs(
        memory=memory + replay_memory(mission, mission.num_windows),
        addresses=addresses + needs.OF_RERUN,
        file=replay_file(mission),
    )


def fly_swarm(
    swarm: Swarm, recorder: Recorder | None, bar: WorkBar, *, way_on: str | None
) -> Flown:
    """Fly a swarm, its policy started, from the first window to the last.

    `way_on` ends the message that memory ran short; None flies on regardless.

    Raises:
        ValueError: As `rollout` does.
        MemoryError: Memory did not suffice for one window.
    """
    flown: list[WindowRecord] = []
    start_s = time.perf_counter()

    def ended(code: int, ending: str = "") -> Flown:
        return Flown(flown, code, ending, time.perf_counter() - start_s)

    with suppress(MemoryError), memory_errors(), deferred_interrupt() as is_interrupted, bar:
        for window in rollout(swarm):
            if recorder:
                recorder.add(window)
            flown.append(window)
            bar.text = f"age {float(window.costs.age_windows[0]):.1f}"
            bar.advance()
            if is_interrupted():
                return ended(INTERRUPTED, "Interrupted")
            is_time = way_on is not None and len(flown) % WINDOWS_BETWEEN_LOOKS == 0
            if recorder and is_time and (short := _shortage(swarm.mission, len(flown), recorder)):
                return ended(FAILED, f"Memory ran short ({short}{way_on})")
        return ended(DONE)
    if not flown:
        raise MemoryError
    return ended(FAILED, "Out of memory")


def compile_ahead(
    mission: Mission, policy_name: str, on_window: Callable[[], object] = lambda: None, **how: Any
) -> None:
    """Fly a small mission of this kind, beyond half-way, so that compiling is not timed.

    Name and `how` are arguments of `make_policy`; `on_window` is called after each window.
    """
    # A stored policy may be for teams of one size, and a file's arena does not shrink.
    is_bound = is_stored(policy_name) or mission.arena not in ARENAS
    robots = mission.num_robots if is_bound else 3
    smallest = replace(mission, num_robots=robots, range_ratio=10.0, num_windows=COMPILING_WINDOWS)
    if is_own_policy(policy_name):  # which may be made for one mission only
        policy_name, how = "tdma", {}
    for _ in rollout(Swarm(smallest, [0]), make_policy(policy_name, smallest, **how)):
        on_window()


def run_of(
    swarm: Swarm, flown: Flown, *, name: str, seed: int, observer: int, components: Components
) -> Run:
    """Return a swarm's mission, flown, as a `Run`; the config is everything that makes it again."""
    mission, policy = swarm.mission, swarm.policy
    config = {
        **asdict(mission),
        "policy": name,
        **policy.parameters,
        "packet_bytes": policy.packet(mission).num_bytes,
        "seed": seed,
        "observer": observer,
        "version": version(),
        "commit": commit(),
        **components.names,
    }
    numbers = flight_numbers(mission, policy, summarise(flown.windows))
    numbers |= {"wall_seconds": flown.wall_s, "interrupted": flown.code != DONE}
    return Run(
        mission=mission, config=config, summary=Metrics(numbers), windows=tuple(flown.windows)
    )


def _shortage(mission: Mission, num_windows: int, recorder: Recorder) -> str | None:
    """Return a message if memory does not suffice to write the replay, at a second look either."""
    needed = replay_memory(mission, num_windows) - recorder.num_bytes
    if free_memory() >= needed:
        return None
    gc.collect()
    time.sleep(SECOND_LOOK_S)
    if (free := free_memory()) >= needed:
        return None
    return f"{in_gb(free)} are free, writing the replay takes {in_gb(needed)}"
