"""The footage of a mission, window by window: what videos show, recorded or read from a replay."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int, Int16, UInt8

from swarm_mj.mission import Mission
from swarm_mj.physics.scene import Scene
from swarm_mj.physics.state import ROBOT_HEIGHT_M
from swarm_mj.replay import links as compared
from swarm_mj.replay import palette
from swarm_mj.replay.links import LinkLines, LinkMismatch, LinkRows, PacketPaths, Positions
from swarm_mj.replay.palette import Fate
from swarm_mj.simulation.components import components_in

VIEW = 1.2  # times the area: a team within it lets a replay's map stand still
NEAR = 1.5  # times the area: robots that stay within it are shown around the area


def turned(
    one: Float[np.ndarray, "N 4"], other: Float[np.ndarray, "N 4"], share: float
) -> Float[np.ndarray, "N 4"]:
    """Return attitudes at a share of the way from one to the other, as quaternions."""
    # Both of a quaternion's signs are the same attitude: the nearer one is the shorter way.
    is_far = np.sum(one * other, axis=1, keepdims=True) < 0.0
    between = one + share * (np.where(is_far, -other, other) - one)
    return between / np.linalg.norm(between, axis=1, keepdims=True)


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
        return Ground(centre_m=np.zeros((len(position_m), 2)), reach_m=max(half_side_m, farthest_m))
    low_m = np.min(position_m, axis=1)
    high_m = np.max(position_m, axis=1)
    if not moves:  # one square for all windows
        low_m = np.broadcast_to(np.min(low_m, axis=0), low_m.shape)
        high_m = np.broadcast_to(np.max(high_m, axis=0), high_m.shape)
    # Of constant size all the same: a changing scale would look like motion. And of some size,
    # also where a lone robot stands still.
    least_m = 0.0 if moves else 1.0
    reach_m = max(least_m, float(np.max(high_m - low_m)) / 2.0)
    return Ground(centre_m=(low_m + high_m) / 2.0, reach_m=reach_m)


def followed(position_m: Positions, mission: Mission) -> Ground:
    """Return the square of the ground that a replay's map shows, for some windows of a flight.

    Each window's centre depends on that window alone: a live replay does not know where the team
    will fly. It stays at the origin until the team would leave `VIEW` times the area.
    """
    half_m = mission.half_side_m
    low_m = np.min(position_m, axis=1)
    high_m = np.max(position_m, axis=1)
    centre_m = np.zeros_like(low_m)
    if not mission.has_walls:
        least_m = high_m - VIEW * half_m
        most_m = low_m + VIEW * half_m
        # A team that is wider than the view has its middle at the centre.
        middle_m = (low_m + high_m) / 2.0
        centre_m = np.where(least_m > most_m, middle_m, np.clip(0.0, least_m, most_m))
    farthest_m = float(np.max(np.abs(position_m - centre_m[:, None])))
    return Ground(centre_m=centre_m, reach_m=max(half_m, farthest_m))


def shown_ground(position_m: Positions, mission: Mission) -> Ground:
    """Return the ground that videos show of a whole flight: tight, unless walls say where it is."""
    return frame(position_m, mission.half_side_m, is_tight=not mission.has_walls)


@dataclass(frozen=True, kw_only=True)
class Facts:
    """The constants of a mission."""

    mission: Mission
    policy: str
    seed: int
    observer: int  # the ego robot
    is_broadcast: bool  # packets have no addressee; otherwise the second phase answers the first
    full_scale: float  # the age from which robots are darkest [windows]
    channel: str | None = None  # the names of the user's own parts
    controller: str | None = None
    scene: str | None = None
    pilot: str | None = None

    @property
    def own_parts(self) -> list[str]:
        """The user's own parts, in words."""
        return [f"{kind} {name}" for kind, name in components_in(vars(self)).names.items()]


@dataclass(frozen=True, kw_only=True)
class Footage:
    """T windows of N robots, each at its end; packets flew during it."""

    facts: Facts
    window: Int[np.ndarray, "T"]  # 1 is the mission's first
    position_m: Positions  # p on the map
    velocity_mps: Float[np.ndarray, "T N 2"]  # v; of a replay that was read, of any length
    is_on: Bool[np.ndarray, "T N"]  # whether a robot had not failed
    known_age: Float[np.ndarray, "T N"]  # of what the ego robot knows [windows]; nan: nothing
    is_cut_off: Bool[np.ndarray, "T N"]  # no packets reach the ego robot, over any number of hops
    age_mean: Float[np.ndarray, "T"]  # mean over all pairs [windows]
    packets: dict[Fate, PacketPaths]  # by their fate, in the order of drawing
    mismatch: LinkMismatch  # has no snapshots in free space
    ground: Ground  # that pictures show
    height_m: Float[np.ndarray, "T N"] | None = None  # of bodies; None: robots are points
    attitude: Float[np.ndarray, "T N 4"] | None = None  # of bodies: quaternions
    scene: Scene | None = None  # what changed the arena; files have its name only

    @property
    def ego(self) -> int:
        """The robot whose knowledge is shown."""
        return self.facts.observer

    @property
    def has_motion(self) -> bool:
        """True if robots may move."""
        return self.facts.mission.moves or self.facts.controller is not None

    @property
    def is_compared(self) -> bool:
        """True if the channel was compared with the belief about it: beyond free space."""
        return len(self.mismatch.window) > 0

    @property
    def cut_off_share(self) -> Float[np.ndarray, "T"]:
        """The share of the other robots, those that are on, that is cut off from the ego robot."""
        return np.sum(self.is_cut_off, axis=1) / np.maximum(1, np.sum(self.is_on, axis=1) - 1)

    @cached_property
    def colours(self) -> UInt8[np.ndarray, "T N 3"]:
        """The robots' colours."""
        return palette.robot_colours(self.known_age, self.facts.full_scale, self.is_on, self.ego)

    def place_m(self, row: int) -> Float[np.ndarray, "N 3"]:
        """Return where the robots' middles are in space in one window [m]."""
        if self.height_m is None:
            return compared.lifted(self.position_m[row], ROBOT_HEIGHT_M)
        return compared.lifted(self.position_m[row], self.height_m[row])

    def moved_to(self, moment: float) -> "Footage":
        """Return the same with the robots of the nearest window moved to a moment between two.

        Moments count windows from 0; packets stay those of the window.
        """
        row = round(moment)
        before = math.floor(moment)
        share = moment - before
        if share == 0.0:
            return self
        after = before + 1

        def moved(values: Float[np.ndarray, "T N *D"]) -> Float[np.ndarray, "T N *D"]:
            whole = values.copy()
            whole[row] = values[before] + share * (values[after] - values[before])
            return whole

        height_m = None if self.height_m is None else moved(self.height_m)
        attitude = None
        if self.attitude is not None:
            attitude = self.attitude.copy()
            attitude[row] = turned(self.attitude[before], self.attitude[after], share)
        return replace(
            self, position_m=moved(self.position_m), height_m=height_m, attitude=attitude
        )

    def packets_at(self, row: int) -> dict[Fate, PacketPaths]:
        """Return one window's packets by their fate; what matters more is drawn over the rest."""
        found: dict[Fate, PacketPaths] = {}
        for fate, packets in self.packets.items():
            first, after = np.searchsorted(packets.row, [row, row + 1])
            found[fate] = PacketPaths(
                row=packets.row[first:after],
                start_m=packets.start_m[first:after],
                end_m=packets.end_m[first:after],
            )
        return found

    def heights_m(self, row: int) -> Float[np.ndarray, "N"]:
        """Return how high the robots are above the floor in one window [m]; points are on it."""
        if self.height_m is None:
            return np.zeros(self.is_on.shape[1])
        return self.height_m[row]

    def above(self, base_m: float) -> float | Float[np.ndarray, "T N"]:
        """Return how high is what is drawn so far above each robot [m]."""
        return base_m if self.height_m is None else self.height_m + base_m

    def is_own(self, links: LinkRows) -> Bool[np.ndarray, "L"]:
        """Tell which links are the observer's: in a city, all of them would hide the robots."""
        return (links["sender"] == self.ego) | (links["receiver"] == self.ego)

    def links(self, row: int) -> LinkRows:
        """Return the observer's links among those compared in one window."""
        links = self.mismatch.at(int(self.window[row]))
        return links[self.is_own(links)]

    def mismatch_lines(
        self, row: int, base_m: float = 0.0
    ) -> tuple[LinkLines, UInt8[np.ndarray, "S 3"]]:
        """Return the lines of one window's links in space, and their colours.

        They are `base_m` above the robots' places [m].
        """
        place_m = compared.lifted(self.position_m[row], self.heights_m(row) + base_m)
        lines_m = []
        colours = []
        for kind, links in compared.by_kind(self.links(row)).items():
            ends_m = compared.ends(links, place_m[None], 0)
            pieces = compared.PIECES[kind]
            lines_m.append(compared.divided(ends_m, pieces))
            colours.append(np.repeat(compared.shades(kind, links), len(pieces), axis=0))
        return np.concatenate(lines_m), np.concatenate(colours)

    def shortfalls(self, row: int) -> tuple[Int16[np.ndarray, "K"], Int16[np.ndarray, "K"]]:
        """Return the robots whose links with the ego robot are too weak, and the margins [dB]."""
        links = self.links(row)
        links = links[links["is_too_weak"]]
        is_sender = links["sender"] == self.ego
        return np.where(is_sender, links["receiver"], links["sender"]), links["margin_db"]
