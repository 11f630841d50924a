"""What a picture shows of one moment of a mission."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from swarm_mj.replay import palette
from swarm_mj.replay.frame import frame
from swarm_mj.replay.links import fates
from swarm_mj.replay.looks import NO_SURPRISES, look
from swarm_mj.replay.shots import shots
from swarm_mj.replay.strokes import strokes_at_once
from swarm_mj.simulation.swarm import Swarm


@dataclass(frozen=True, kw_only=True)
class Contents:
    """N robots, L packets, S lines of links that surprise, and the ground that a picture shows."""

    position_m: Float[np.ndarray, "N 2"]  # p [m]
    velocity_mps: Float[np.ndarray, "N 2"]  # v; only its direction is drawn
    colour: UInt8[np.ndarray, "N 3"]
    observer: int  # the robot that is drawn larger
    start_m: Float[np.ndarray, "L 2"]  # where packets begin and end [m]
    end_m: Float[np.ndarray, "L 2"]
    link_colour: UInt8[np.ndarray, "L 3"]
    strokes_m: Float[np.ndarray, "S 2 2"]  # links that surprise, from start to end [m]
    stroke_colour: UInt8[np.ndarray, "S 3"]
    is_cut_off: Bool[np.ndarray, "N"]  # whether it can exchange no news with the observer
    centre_m: Float[np.ndarray, "2"]  # of the square [m]
    reach_m: float  # half its side [m]


@dataclass(frozen=True, kw_only=True)
class _Flown:
    """The packets of a swarm's last window, as `fates` takes them."""

    recipient: Int[np.ndarray, "1 2 N"]
    heard: Int[np.ndarray, "1 2 N"]
    is_broadcast: bool


def contents_of(
    swarm: Swarm,
    index: int = 0,
    *,
    observer: int = 0,
    is_broadcast: bool = False,
    full_scale: float | None = None,
) -> Contents:
    """What a swarm looks like now, with the packets of the window just flown.

    Args:
        swarm: The missions.
        index: Which of them is shown.
        observer: The robot by whose knowledge the others are coloured; it is white itself.
        is_broadcast: Whether windows are two broadcasts (IV-C) instead of those of Alg. 1.
        full_scale: The age from which robots are darkest [windows]; unless given, the number of
            robots: a round in which everyone has its turn.

    Returns:
        The contents of a picture.

    Raises:
        ValueError: There is no such mission or robot.
    """
    num_robots = swarm.mission.num_robots
    for what, value, end in (("index", index, len(swarm.now)), ("observer", observer, num_robots)):
        if not 0 <= value < end:
            raise ValueError(f"{what} must be from 0 to {end - 1}, not {value}")
    states = swarm.states
    position_m = states.position_m[index].copy()
    seen = shots(fates(_flown(swarm, index, is_broadcast)), position_m[None])
    half_side_m = swarm.mission.half_side_m
    square = frame(position_m[None], half_side_m)
    granted = look(swarm, index)
    group = np.zeros(num_robots, np.int16) if granted is None else granted.group
    surprises = NO_SURPRISES if granted is None else granted.surprises
    lines_m, line_colour = strokes_at_once(surprises, position_m, observer)
    is_on = _is_on(swarm, index)
    return Contents(
        position_m=position_m,
        velocity_mps=states.velocity_mps[index].copy(),
        colour=_colours(swarm, index, observer, full_scale or float(num_robots)),
        observer=observer,
        start_m=seen.start_m,
        end_m=seen.end_m,
        link_colour=seen.colour,
        strokes_m=lines_m,
        stroke_colour=line_colour,
        is_cut_off=is_on & is_on[observer] & (group != group[observer]),
        centre_m=square.centre_m[0],
        reach_m=max(half_side_m, square.reach_m),  # as wide wherever the team is
    )


def _flown(swarm: Swarm, index: int, is_broadcast: bool) -> _Flown:
    silent = np.tile(np.arange(swarm.mission.num_robots), (1, 2, 1))
    phases = swarm.phases
    return _Flown(
        recipient=np.stack([[p.recipient[index] for p in phases]]) if phases else silent,
        heard=np.stack([[p.heard[index] for p in phases]]) if phases else silent,
        is_broadcast=is_broadcast,
    )


def _colours(
    swarm: Swarm, index: int, observer: int, full_scale: float
) -> UInt8[np.ndarray, "N 3"]:
    age = swarm.now[index] - swarm.buffers.timestamp[index, observer]
    is_known = swarm.buffers.is_known[index, observer]
    is_on = _is_on(swarm, index)
    return palette.robot_colours(age, full_scale, is_known, is_on, observer)


def _is_on(swarm: Swarm, index: int) -> Bool[np.ndarray, "N"]:
    is_active = swarm.states.is_active
    return np.ones(swarm.mission.num_robots, bool) if is_active is None else is_active[index]
