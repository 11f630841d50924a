"""What a picture shows of one moment of a mission."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, UInt8

from swarm_mj.replay import palette
from swarm_mj.replay.footage import frame
from swarm_mj.replay.mismatch import LinkMismatch, coloured_lines, radio_snapshot
from swarm_mj.replay.packets import PacketSegments, fates, packet_segments
from swarm_mj.simulation.swarm import Swarm


@dataclass(frozen=True, kw_only=True)
class Contents:
    """N robots, L packets, S lines of mismatched links, and the ground that a picture shows."""

    position_m: Float[np.ndarray, "N 2"]  # p [m]
    velocity_mps: Float[np.ndarray, "N 2"]  # v; only its direction is drawn
    colour: UInt8[np.ndarray, "N 3"]
    observer: int  # the robot that is drawn larger
    start_m: Float[np.ndarray, "L 2"]  # where packets begin and end [m]
    end_m: Float[np.ndarray, "L 2"]
    packet_colour: UInt8[np.ndarray, "L 3"]
    lines_m: Float[np.ndarray, "S 2 2"]  # mismatched links, from start to end [m]
    line_colour: UInt8[np.ndarray, "S 3"]
    is_cut_off: Bool[np.ndarray, "N"]  # whether it can exchange no packets with the observer
    centre_m: Float[np.ndarray, "2"]  # of the square [m]
    reach_m: float  # half its side [m]


def links_of(
    segments: Mapping[str, PacketSegments],
    mismatch: LinkMismatch | None,
    position_m: Float[np.ndarray, "N 2"],
    observer: int,
    row: int = 0,
) -> dict[str, np.ndarray]:
    """Return the packets and mismatched links of one window, as fields of `Contents`.

    Args:
        segments: Packets of all windows, by their fate.
        mismatch: Links of this window.
        position_m: The robots' [m].
        observer: The robot whose links that are too weak are shown.
        row: The window, from 0.
    """
    starts, ends = [np.zeros((0, 2))], [np.zeros((0, 2))]
    colours = [np.zeros((0, 3), dtype=np.uint8)]
    for fate, drawn in segments.items():
        first, last = np.searchsorted(drawn.row, [row, row + 1])
        starts.append(drawn.start_m[first:last])
        ends.append(drawn.end_m[first:last])
        colour = np.array(palette.PACKETS[fate][0], dtype=np.uint8)
        colours.append(np.tile(colour, (last - first, 1)))
    lines_m, line_colour = coloured_lines(mismatch, position_m, observer)
    return {
        "start_m": np.concatenate(starts),
        "end_m": np.concatenate(ends),
        "packet_colour": np.concatenate(colours),
        "lines_m": lines_m,
        "line_colour": line_colour,
    }


def contents_of(
    swarm: Swarm,
    index: int = 0,
    *,
    observer: int = 0,
    is_broadcast: bool = False,
    full_scale: float | None = None,
) -> Contents:
    """Return what a swarm looks like now, with the packets of the window just flown.

    Args:
        swarm: The missions.
        index: The mission that is shown.
        observer: The robot by whose knowledge the others are coloured; it is white itself.
        is_broadcast: Whether windows are two broadcasts (IV-C) instead of those of Alg. 1.
        full_scale: The age from which robots are darkest [windows]; unless given, the number of
            robots: a round in which everyone has its turn.

    Raises:
        ValueError: There is no such mission or robot.
    """
    num_robots = swarm.mission.num_robots
    for what, value, end in (("index", index, len(swarm.now)), ("observer", observer, num_robots)):
        if not 0 <= value < end:
            raise ValueError(f"{what} must be from 0 to {end - 1}, not {value}")
    states, buffers = swarm.states, swarm.buffers
    position_m = states.position_m[index].copy()
    is_on = np.ones(num_robots, bool) if states.is_active is None else states.is_active[index]
    age = swarm.now[index] - buffers.timestamp[index, observer]
    is_known = buffers.is_known[index, observer]
    seen = radio_snapshot(swarm, index)
    group = np.zeros(num_robots, np.int16) if seen is None else seen.group
    half_side_m = swarm.mission.half_side_m
    square = frame(position_m[None], half_side_m)
    return Contents(
        position_m=position_m,
        velocity_mps=states.velocity_mps[index].copy(),
        colour=palette.robot_colours(
            age, full_scale or float(num_robots), is_known, is_on, observer
        ),
        observer=observer,
        **links_of(
            _last_packets(swarm, index, is_broadcast),
            None if seen is None else seen.mismatch,
            position_m,
            observer,
        ),
        is_cut_off=is_on & is_on[observer] & (group != group[observer]),
        centre_m=square.centre_m[0],
        reach_m=max(half_side_m, square.reach_m),  # as wide wherever the team is
    )


def _last_packets(swarm: Swarm, index: int, is_broadcast: bool) -> dict[str, PacketSegments]:
    """Return the packets of one mission's last window; before the first one there are none."""
    if not swarm.phases:
        return {}
    recipient = np.stack([[phase.recipient[index] for phase in swarm.phases]])
    heard = np.stack([[phase.heard[index] for phase in swarm.phases]])
    packets = fates(recipient, heard, is_broadcast=is_broadcast)
    return packet_segments(packets, swarm.states.position_m[index][None])
