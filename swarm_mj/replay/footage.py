"""The footage of a mission for pictures and videos, window by window, kept in replays."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int, Int16, UInt8

from swarm_mj.mission import Mission
from swarm_mj.mission.components import Components, components_in
from swarm_mj.physics.scene import Scene
from swarm_mj.replay import palette
from swarm_mj.replay.mismatch import LinkMismatch, coloured_lines, radio_snapshot
from swarm_mj.replay.packets import PacketSegments, fates, packet_segments
from swarm_mj.replay.recorder import Log
from swarm_mj.simulation.swarm import Swarm

NEAR = 1.5  # times the area: robots that stay within it are shown around the area


@dataclass(frozen=True, kw_only=True)
class Ground:
    """The part of the ground that is shown: a square of constant size that may move."""

    centre_m: Float[np.ndarray, "T 2"]  # in each window [m]
    reach_m: float  # half its width [m]

    @property
    def moves(self) -> bool:
        """True if it follows the team."""
        return bool(np.any(self.centre_m))


def frame(position_m: Float[np.ndarray, "T N 2"], half_side_m: float) -> Ground:
    """Return the smallest square that holds the area and all ways, or else all robots at any time.

    It follows the team if robots go far beyond the area, which is centred on the origin.
    """
    farthest_m = float(np.max(np.abs(position_m)))
    if farthest_m <= NEAR * half_side_m:
        centre_m = np.zeros((len(position_m), 2))
        return Ground(centre_m=centre_m, reach_m=max(half_side_m, farthest_m))
    low_m, high_m = np.min(position_m, axis=1), np.max(position_m, axis=1)
    # Of constant size all the same: a changing scale would look like motion.
    return Ground(centre_m=(low_m + high_m) / 2.0, reach_m=float(np.max(high_m - low_m)) / 2.0)


@dataclass(frozen=True, kw_only=True)
class Facts:
    """The constants of a mission."""

    mission: Mission
    policy: str
    seed: int
    observer: int
    is_broadcast: bool
    full_scale: float  # the age from which robots are darkest [windows]
    channel: str | None = None  # the names of the user's own parts
    controller: str | None = None
    scene: str | None = None

    @property
    def own_parts(self) -> list[str]:
        """The user's own parts, in words."""
        return [f"{kind} {name}" for kind, name in components_in(vars(self)).names.items()]


@dataclass(frozen=True, kw_only=True)
class Contents:
    """One moment's N robots, L packets, S lines of mismatched links, and the ground shown."""

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


@dataclass(frozen=True, kw_only=True)
class Footage:
    """T windows of N robots."""

    facts: Facts
    window: Int[np.ndarray, "T"]  # 1 is the mission's first
    position_m: Float[np.ndarray, "T N 2"]  # p [m]
    velocity_mps: Float[np.ndarray, "T N 2"]  # of any length: only its direction is shown
    age: Float[np.ndarray, "T N"]  # of what the observer knows [windows]; nan: nothing
    is_on: Bool[np.ndarray, "T N"]  # whether a robot was switched on
    segments: dict[str, PacketSegments]  # packets by their fate, in the order of drawing
    age_mean: Float[np.ndarray, "T"]  # Eq. 10 [windows]
    is_cut_off: Bool[np.ndarray, "T N"]  # whether it can exchange no packets with the observer
    mismatch: LinkMismatch | None = None  # None in free space
    scene: Scene | None = None  # what changed the arena; files have its name only

    @cached_property
    def frame(self) -> Ground:
        """The part of the ground that is shown: of an open area, only where robots ever are."""
        mission = self.facts.mission
        whole = frame(self.position_m, mission.half_side_m)
        if whole.moves or mission.has_walls:
            return whole
        low_m, high_m = (end(self.position_m, axis=(0, 1)) for end in (np.min, np.max))
        centre_m = np.tile((low_m + high_m) / 2.0, (len(self.window), 1))
        return Ground(centre_m=centre_m, reach_m=max(1.0, float(np.max(high_m - low_m)) / 2.0))

    def contents(self, row: int, full_scale: float | None = None) -> Contents:
        """Return a moment's picture: the window, from 0, by a scale of ages [windows]."""
        position_m, age, facts = self.position_m[row], self.age[row], self.facts
        starts, ends = [np.zeros((0, 2))], [np.zeros((0, 2))]
        colours = [np.zeros((0, 3), dtype=np.uint8)]
        # The fates are in the order of drawing, so that what matters more covers the rest.
        for fate, drawn in self.segments.items():
            first, last = np.searchsorted(drawn.row, [row, row + 1])
            starts.append(drawn.start_m[first:last])
            ends.append(drawn.end_m[first:last])
            colour = np.array(palette.PACKETS[fate][0], dtype=np.uint8)
            colours.append(np.tile(colour, (last - first, 1)))
        lines_m, line_colour = coloured_lines(self.mismatch_at(row), position_m, facts.observer)
        scale = facts.full_scale if full_scale is None else full_scale
        return Contents(
            position_m=position_m,
            velocity_mps=self.velocity_mps[row],
            colour=palette.robot_colours(
                np.nan_to_num(age), scale, ~np.isnan(age), self.is_on[row], facts.observer
            ),
            observer=facts.observer,
            start_m=np.concatenate(starts),
            end_m=np.concatenate(ends),
            packet_colour=np.concatenate(colours),
            lines_m=lines_m,
            line_colour=line_colour,
            is_cut_off=self.is_cut_off[row],
            centre_m=self.frame.centre_m[row],
            reach_m=self.frame.reach_m,
        )

    def mismatch_at(self, row: int) -> LinkMismatch | None:
        """Return the links that differ from the belief in one window, counted from 0."""
        return None if self.mismatch is None else self.mismatch.at(int(self.window[row]))

    def shortfalls(self, row: int) -> tuple[Int16[np.ndarray, "K"], Int16[np.ndarray, "K"]]:
        """Return the robots whose links with the observer are too weak, and the margins [dB]."""
        if (links := self.mismatch_at(row)) is None:
            return np.zeros(0, np.int16), np.zeros(0, np.int16)
        own = self.facts.observer
        links = links.chosen(links.is_too_weak & links.of_robot(own))
        return np.where(links.sender == own, links.receiver, links.sender), links.margin_db


def footage_of(
    log: Log, mission: Mission, policy: str, seed: int, own: Components = Components()
) -> Footage:
    """Return what a video shows of a recorded mission; `own` are the user's components."""
    facts = Facts(
        mission=mission,
        policy=policy,
        seed=seed,
        observer=log.ego,
        is_broadcast=log.is_broadcast,
        full_scale=palette.nice_scale(log.age),
        **own.names,
    )
    return Footage(
        facts=facts,
        window=log.window,
        position_m=log.position_m,
        velocity_mps=log.velocity_mps,
        age=log.known_age,
        is_on=log.is_on,
        segments=packet_segments(log.packets, log.position_m),
        age_mean=log.age_mean,
        is_cut_off=log.is_cut_off,
        mismatch=log.mismatch,
        scene=log.scene,
    )


def contents_of(
    swarm: Swarm,
    index: int = 0,
    *,
    observer: int = 0,
    full_scale: float | None = None,
) -> Contents:
    """Return a picture of one of a swarm's missions now, with the window just flown.

    Robots are coloured by what the observer knows of them, darkest from an age of `full_scale`
    windows on: the number of robots unless given, a round in which everyone has its turn. Raise
    ValueError if there is no such mission or robot.
    """
    mission, states, buffers = swarm.mission, swarm.states, swarm.buffers
    num = mission.num_robots
    for what, value, end in (("index", index, len(swarm.now)), ("observer", observer, num)):
        if not 0 <= value < end:
            raise ValueError(f"{what} must be from 0 to {end - 1}, not {value}")
    # A copy: the swarm writes its arrays in place, and the picture may be drawn later.
    position_m = states.position_m[index].copy()
    is_on = np.ones(num, bool) if states.is_active is None else states.is_active[index]
    age = swarm.now[index] - buffers.timestamp[index, observer]
    seen = radio_snapshot(swarm, index)
    is_apart = np.zeros(num, bool) if seen is None else seen.group != seen.group[observer]
    footage = Footage(
        facts=Facts(
            mission=mission,
            policy="",
            seed=0,
            observer=observer,
            is_broadcast=swarm.is_broadcast,
            full_scale=full_scale or float(num),
        ),
        window=np.array([1]),
        position_m=position_m[None],
        velocity_mps=states.velocity_mps[[index]],
        age=np.where(buffers.is_known[index, observer], age, np.nan)[None],
        is_on=is_on[None],
        segments=_last_packets(swarm, index),
        age_mean=np.zeros(1),
        is_cut_off=(is_on & is_on[observer] & is_apart)[None],
        mismatch=None if seen is None else seen.mismatch,
    )
    # As wide wherever the team is: a live picture does not know where it will fly.
    square = frame(footage.position_m, mission.half_side_m)
    reach_m = max(mission.half_side_m, square.reach_m)
    return replace(footage.contents(0), centre_m=square.centre_m[0], reach_m=reach_m)


def _last_packets(swarm: Swarm, index: int) -> dict[str, PacketSegments]:
    """Return the packets of one mission's last window; before the first one there are none."""
    if not swarm.phases:
        return {}
    recipient = np.stack([[phase.recipient[index] for phase in swarm.phases]])
    heard = np.stack([[phase.heard[index] for phase in swarm.phases]])
    packets = fates(recipient, heard, is_broadcast=swarm.is_broadcast)
    return packet_segments(packets, swarm.states.position_m[[index]])
