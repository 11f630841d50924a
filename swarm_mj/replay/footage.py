"""The footage of a mission for pictures and videos, window by window, kept in replays."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int, Int16, UInt8

from swarm_mj.mission import Mission
from swarm_mj.mission.components import Components, components_in
from swarm_mj.physics.scene import Scene
from swarm_mj.replay import palette
from swarm_mj.replay.links import (
    NO_MISMATCH,
    PIECES,
    Lines,
    LinkMismatch,
    LinkRows,
    PacketSegments,
    Positions,
    by_kind,
    divided,
    ends,
    packet_segments,
    shades,
)
from swarm_mj.replay.recorder import Log, Recorder
from swarm_mj.simulation.swarm import Swarm

NEAR = 1.5  # times the area: robots that stay within it are shown around the area
AS_RECORDED = ("window", "position_m", "velocity_mps", "is_on", "is_cut_off", "age_mean", "scene")


@dataclass(frozen=True, kw_only=True)
class Ground:
    """The part of the ground that is shown: a square of constant size that may move."""

    centre_m: Float[np.ndarray, "T 2"]  # in each window [m]
    reach_m: float  # half its width [m]

    @property
    def moves(self) -> bool:
        """True if it follows the team."""
        return bool(np.any(self.centre_m))


def frame(position_m: Positions, half_side_m: float, *, is_tight: bool = False) -> Ground:
    """Return the smallest square that holds the area and all ways, or else all robots at any time.

    It follows the team if robots go far beyond the area, which is centred on the origin. A tight
    one holds all ways only, if it does not follow.
    """
    farthest_m = float(np.max(np.abs(position_m)))
    moves = farthest_m > NEAR * half_side_m
    if not moves and not is_tight:
        centre_m = np.zeros((len(position_m), 2))
        return Ground(centre_m=centre_m, reach_m=max(half_side_m, farthest_m))
    axis = 1 if moves else (0, 1)
    low_m, high_m = (end(position_m, axis=axis, keepdims=True) for end in (np.min, np.max))
    # Of constant size all the same: a changing scale would look like motion.
    reach_m = max(0.0 if moves else 1.0, float(np.max(high_m - low_m)) / 2.0)
    centre_m = np.broadcast_to((low_m + high_m)[:, 0] / 2.0, (len(position_m), 2))
    return Ground(centre_m=centre_m, reach_m=reach_m)


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
class Footage:
    """T windows of N robots."""

    facts: Facts
    window: Int[np.ndarray, "T"]  # 1 is the mission's first
    position_m: Positions  # p
    velocity_mps: Float[np.ndarray, "T N 2"]  # of any length: only its direction is shown
    age: Float[np.ndarray, "T N"]  # of what the observer knows [windows]; nan: nothing
    is_on: Bool[np.ndarray, "T N"]  # whether a robot had not failed
    segments: dict[str, PacketSegments]  # packets by their fate, in the order of drawing
    age_mean: Float[np.ndarray, "T"]  # Eq. 10 [windows]
    is_cut_off: Bool[np.ndarray, "T N"]  # whether it can exchange no packets with the observer
    ground: Ground  # that pictures show
    mismatch: LinkMismatch = NO_MISMATCH
    scene: Scene | None = None  # what changed the arena; files have its name only

    def colours(self, row: int) -> UInt8[np.ndarray, "N 3"]:
        """Return the robots' colours in one window, counted from 0."""
        scale, observer = self.facts.full_scale, self.facts.observer
        return palette.robot_colours(self.age[row], scale, self.is_on[row], observer)

    def packets(self, row: int) -> Iterator[tuple[np.ndarray, np.ndarray, palette.Colour]]:
        """Yield one window's starts [L 2] and ends [L 2] of packets [m], and their colour.

        The fates are in the order of drawing, so that what matters more covers the rest.
        """
        for fate, drawn in self.segments.items():
            its = slice(*np.searchsorted(drawn.row, [row, row + 1]))
            yield drawn.start_m[its], drawn.end_m[its], palette.PACKETS[fate][0]

    def links(self, row: int) -> LinkRows:
        """Return the links that are shown in one window: of those too weak, the observer's only.

        In a city, all of them together would not show which robots each one joins.
        """
        links = self.mismatch.at(int(self.window[row]))
        is_own = [links[end] == self.facts.observer for end in ("sender", "receiver")]
        return links[np.any(is_own, axis=0) | ~links["is_too_weak"]]

    def mismatch_lines(self, row: int) -> tuple[Lines, UInt8[np.ndarray, "S 3"]]:
        """Return the lines of one window's links [m], and their colours."""
        lines_m, colours = [], []
        for kind, links in by_kind(self.links(row)).items():
            lines_m.append(divided(ends(links, self.position_m, row), PIECES[kind]))
            colours.append(np.repeat(shades(kind, links), len(PIECES[kind]), axis=0))
        return np.concatenate(lines_m), np.concatenate(colours)

    def shortfalls(self, row: int) -> tuple[Int16[np.ndarray, "K"], Int16[np.ndarray, "K"]]:
        """Return the robots whose links with the observer are too weak, and the margins [dB]."""
        links, own = self.links(row), self.facts.observer
        links = links[links["is_too_weak"]]
        is_sender = links["sender"] == own
        return np.where(is_sender, links["receiver"], links["sender"]), links["margin_db"]


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
        age=log.known_age,
        segments=packet_segments(log.packets, log.position_m),
        ground=frame(log.position_m, mission.half_side_m, is_tight=not mission.has_walls),
        mismatch=log.mismatch or NO_MISMATCH,
        **{name: getattr(log, name) for name in AS_RECORDED},
    )


def footage_now(
    swarm: Swarm, index: int = 0, *, observer: int = 0, full_scale: float | None = None
) -> Footage:
    """Return one of a swarm's missions as it is now, with the packets of the window just flown.

    Robots are coloured by what the observer knows of them, darkest from an age of `full_scale`
    windows on: the number of robots unless given, a round in which everyone has its turn. Raise
    ValueError if there is no such mission or robot.
    """
    if not 0 <= index < len(swarm.now):
        raise ValueError(f"index must be from 0 to {len(swarm.now) - 1}, not {index}")
    mission, recorder = swarm.mission, Recorder(swarm, ego=observer, index=index)
    recorder.add()
    seen = footage_of(recorder.log(), mission, "", 0)
    facts = replace(seen.facts, full_scale=full_scale or float(mission.num_robots))
    # As wide wherever the team is: a live picture does not know where it will fly.
    ground = frame(seen.position_m, mission.half_side_m)
    ground = replace(ground, reach_m=max(mission.half_side_m, ground.reach_m))
    return replace(seen, facts=facts, ground=ground)
