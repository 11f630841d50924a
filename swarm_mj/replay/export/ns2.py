"""Replays as traces of ns-2's `setdest`, which ns-3 reads by its `Ns2MobilityHelper`.

In a window the robots of the simulation move first, and then stand while two slots pass. So a trace
has each robot in place when either slot begins: it goes to its next place during the second one,
after the packets of that slot have begun. A simulator that decides a reception by where the robots
are when a packet begins, as ns-3's channels do, so decides it where ours did. `setdest` is planar,
so robots with bodies stay at the height where they begin: where ns-3 is made to set a height later,
it forgets the way on the ground.
"""

from collections.abc import Callable, Iterator

import numpy as np

from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.replay.export.flown import DIGITS, FlownWindows
from swarm_mj.replay.log import RESPONSE


def trace(flown: FlownWindows, advance: Callable[[], None]) -> bytes:
    """Return the trace of how the robots moved."""
    lines = [*_about(flown), *_start(flown)]
    for row in range(len(flown.footage.window)):
        lines.extend(_legs(flown, row))
        advance()
    return "".join(f"{line}\n" for line in lines).encode()


def _about(flown: FlownWindows) -> Iterator[str]:
    """Yield comments: the flight, and the numbers of its radio."""
    facts = flown.footage.facts
    mission = facts.mission
    radio = radio_of(mission)
    yield f"# {mission.task}, {mission.num_robots} robots, {facts.policy}, seed {facts.seed}"
    yield f"# window {mission.window_s:g} s, of 2 slots; path loss {mission.path_loss}"
    yield (
        f"# radio: power {radio.power_mw:.6g} mW, noise {radio.noise_mw:.6g} mW, "
        f"SINR threshold {radio.threshold:.6g}, frequency {radio.frequency_hz:.6g} Hz"
    )


def _start(flown: FlownWindows) -> Iterator[str]:
    for robot, (x_m, y_m, z_m) in enumerate(flown.place_m[0].tolist()):
        yield f"$node_({robot}) set X_ {x_m:.{DIGITS}f}"
        yield f"$node_({robot}) set Y_ {y_m:.{DIGITS}f}"
        height = f"{z_m:.{DIGITS}f}" if flown.has_bodies else "0.0"
        yield f"$node_({robot}) set Z_ {height}"


def _legs(flown: FlownWindows, row: int) -> Iterator[str]:
    """Yield the ways to where the robots are in the next window; those at rest have none."""
    position_m = np.round(flown.footage.position_m, DIGITS)
    if row + 1 == len(position_m):
        return
    begin_s = flown.begin_s(row, RESPONSE)
    way_m = np.linalg.norm(position_m[row + 1] - position_m[row], axis=1)
    speed_mps = way_m / (SLOT_WINDOWS * flown.window_s)
    for robot in np.flatnonzero(way_m).tolist():
        x_m, y_m = position_m[row + 1, robot].tolist()
        place = f"{x_m:.{DIGITS}f} {y_m:.{DIGITS}f}"
        yield f'$ns_ at {begin_s:.9g} "$node_({robot}) setdest {place} {speed_mps[robot]:.12g}"'
