"""Links between robots in recorded windows: packets, and those on which channel and belief differ.

Packets have a fate and are drawn by it. Policies believe in mean powers: a lone packet decodes if
its mean power is above the threshold. The fading and losses of single packets are no mismatch.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Int, Int16, Shaped, UInt8

from swarm_mj.mission.geometry import HEIGHT, PLANE
from swarm_mj.radio.composed import strong_groups
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.replay import palette
from swarm_mj.replay.palette import Fate, LinkKind
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.decibels import to_db

Phases: TypeAlias = Int[np.ndarray, "T 2 N"]  # a robot for each one in both phases of windows
Positions: TypeAlias = Float[np.ndarray, "T N D"]  # of all robots in each window [m]
Places: TypeAlias = Float[np.ndarray, "L D"]  # an end of each packet [m]; of bodies with heights

SEGMENTS = 6  # straight pieces of an arc
RISE = 0.22  # of an arc's top, by its span

EVERY = 5  # windows between snapshots; in between, the last one is shown
WAY_SHARE = 0.005  # of the area's side, that robots may fly between snapshots

# Pieces that a line is drawn in, from where to where [of its length]: the dashes of a link that is
# too weak cover DASH of the way to the next one's start.
WHOLE = np.array([[0.0, 1.0]])
NUM_DASHES = 4
DASH = 0.6
DASHES = (np.arange(NUM_DASHES)[:, None] + [0.0, DASH]) / (NUM_DASHES - 1 + DASH)
PIECES: dict[LinkKind, Float[np.ndarray, "_ 2"]] = {"unbelieved": WHOLE, "too_weak": DASHES}
FAINTEST = 0.5  # the shade of a link that misses `FAINTEST_DB` or more
FAINTEST_DB = -30.0
BRIGHTEST = 0.85  # of one that is hardly too weak

# A link that is believed in but too weak to decode, or decodes although policies do not believe in
# it; once for both directions. `loss_db` is between the antennas, `margin_db` of the mean power
# over what decodes. Files keep these four numbers.
NUMBERS = ("sender", "receiver", "loss_db", "margin_db")
LINK = np.dtype(
    [
        ("row", int),  # of the snapshot
        ("sender", np.int16),
        ("receiver", np.int16),
        ("loss_db", np.int16),
        ("margin_db", np.int16),
        ("is_too_weak", bool),
    ]
)
LinkRows: TypeAlias = Shaped[np.ndarray, "_"]  # an array of `LINK`
LinkLines: TypeAlias = Float[np.ndarray, "_ 2 D"]  # from start to end, on the map or in space [m]


class PacketPaths(NamedTuple):
    """L packets with the same fate, sorted by window."""

    row: Int[np.ndarray, "L"]  # the window, 0 to T - 1
    start_m: Places  # where the sender is
    end_m: Places  # where the receiver is


def fates(
    recipient: Phases, heard: Phases, position_m: Positions, *, is_broadcast: bool
) -> dict[Fate, PacketPaths]:
    """Sort the packets of T windows by their fate, in the order of drawing.

    Addressed packets are delivered, lost, overheard, answered or unanswered. `lost` and
    `unanswered` ones end at the robot they were meant for, which did not decode them; a packet that
    k other robots overheard is k packets here. Broadcasts have no addressee: `heard` leads to each
    hearer. The second phase answers the first. `recipient` is S^i in both phases, `heard` the
    sender that each robot decoded; a robot's own number is none.
    """
    # A robot decodes at most one packet in a phase, so `heard` has every reception once.
    row, phase, hearer = np.nonzero(is_other(heard))
    speaker = heard[row, phase, hearer]
    received = np.stack([row, speaker, hearer])
    if is_broadcast:
        found: dict[Fate, np.ndarray] = {"heard": received}
    else:
        is_overheard = recipient[row, phase, speaker] != hearer
        row, phase, sender = np.nonzero(is_other(recipient))
        receiver = recipient[row, phase, sender]
        is_decoded = heard[row, phase, receiver] == sender
        is_request = phase == 0
        sent = np.stack([row, sender, receiver])
        found = {
            "overheard": received[:, is_overheard],
            "unanswered": sent[:, ~is_request & ~is_decoded],
            "lost": sent[:, is_request & ~is_decoded],
            "delivered": sent[:, is_request & is_decoded],
            "answered": sent[:, ~is_request & is_decoded],
        }
    paths: dict[Fate, PacketPaths] = {}
    for fate, (row, sender, receiver) in found.items():
        start_m = position_m[row, sender]
        end_m = position_m[row, receiver]
        paths[fate] = PacketPaths(row=row, start_m=start_m, end_m=end_m)
    return paths


def is_other(robot: Phases) -> Bool[np.ndarray, "T 2 N"]:
    """Tell where a robot addresses, or decodes, another one."""
    return robot != np.arange(robot.shape[2])


def lifted(
    at_m: Float[np.ndarray, "*S 2"], height_m: float | Float[np.ndarray, "*S"]
) -> Float[np.ndarray, "*S 3"]:
    """Return points at a height above the ground, one for all or each its own [m]."""
    up_m = np.broadcast_to(height_m, at_m.shape[:-1])
    return np.concatenate([at_m, up_m[..., None]], axis=-1)


def on_map(at_m: Float[np.ndarray, "*S D"]) -> Float[np.ndarray, "*S 2"]:
    """Return points of the plane, or of space, as the map shows them [m]."""
    return at_m[..., :PLANE]


def flattened(at_m: Float[np.ndarray, "*S 3"]) -> Float[np.ndarray, "*S 2"]:
    """Return the points on the ground below: what `lifted` was given [m]."""
    return np.delete(at_m, 2, axis=-1)


def arcs(
    packets: PacketPaths, base_m: float, share: float = 1.0, rise: float = RISE
) -> Float[np.ndarray, "L P 3"]:
    """Return points along parabolas that start and end at `base_m` above the robots' places [m].

    They cover this share of the way to the receiver: lost packets stop short of it. The top is as
    high as `rise` times the way.
    """
    along = np.linspace(0.0, 1.0, SEGMENTS + 1)
    way_m = share * (packets.end_m - packets.start_m)
    span_m = np.linalg.norm(way_m, axis=1)
    # The longer the higher: packets that cross on the ground stay apart in the picture.
    height_m = base_m + 4.0 * rise * span_m[:, None] * along * (1.0 - along)
    points_m = packets.start_m[:, None] + along[:, None] * way_m[:, None]
    if points_m.shape[2] > PLANE:  # of bodies, which have heights of their own
        height_m = height_m + points_m[..., HEIGHT]
    return np.concatenate([points_m[..., :PLANE], height_m[..., None]], axis=2)


class LinkMismatch(NamedTuple):
    """The L links that differ in C snapshots, each of which stands until the next."""

    window: Int[np.ndarray, "C"]  # of each snapshot; 1 is the mission's first
    links: LinkRows  # with the row of their snapshot, ascending

    def at(self, window: int) -> LinkRows:
        """Return the links of the snapshot that stands for a window."""
        row = np.searchsorted(self.window, window, side="right") - 1
        return self.links[self.links["row"] == row]


NO_MISMATCH = LinkMismatch(window=np.zeros(0, dtype=int), links=np.zeros(0, LINK))


class RadioSnapshot(NamedTuple):
    """The mean links of one mission at one moment."""

    group: Int16[np.ndarray, "N"]  # the first of the robots that each is connected with
    links: LinkRows  # that differ
    num_believed: int  # links that are believed in, one for both directions
    num_working: int  # links that decode, likewise


def stride_of(swarm: Swarm, min_stride: int = 1) -> int:
    """Return the windows between snapshots: so few that robots hardly move, but not fewer."""
    mission = swarm.mission
    way_m = mission.max_velocity_mps * mission.window_s
    return max(1, min_stride, min(EVERY, int(WAY_SHARE * mission.side_m / way_m)))


def radio_snapshot(swarm: Swarm, index: int = 0) -> RadioSnapshot | None:
    """Compare a mission's channel with the belief; None in free space, and for a user's own."""
    channel = swarm.truth.channel
    if channel is None:
        return None
    mission = swarm.mission
    position_m = swarm.states.position_m[index]
    true_mw = channel.mean_powers_mw(position_m, index)
    believed_mw = swarm.belief.links(position_m).received_mw
    min_mw = channel.reception.noise_mw * channel.reception.threshold
    is_on = swarm.states.is_active
    here = np.ones(mission.num_robots, dtype=bool) if is_on is None else is_on[index]
    pairs = here[:, None] & here & ~np.eye(mission.num_robots, dtype=bool)
    is_true = pairs & (true_mw >= min_mw)
    is_believed = pairs & (believed_mw >= min_mw)
    differs = is_true != is_believed
    differs &= ~np.tril(differs.T)  # the other direction stands for both
    links = np.zeros(int(np.sum(differs)), LINK)
    links["sender"], links["receiver"] = np.nonzero(differs)
    links["is_too_weak"] = is_believed[differs]
    power_mw = np.maximum(true_mw[differs], np.finfo(float).tiny)
    radio = radio_of(mission)
    loss_at_1_m = radio.power_mw / radio.received_at_1_m_mw
    links["loss_db"] = np.round(to_db(channel.at_1_m_mw[differs] * loss_at_1_m / power_mw))
    # Rounded down: a packet that does not decode must not show a margin of 0 dB.
    links["margin_db"] = np.floor(to_db(power_mw / min_mw))
    return RadioSnapshot(
        group=strong_groups(is_true).astype(np.int16),
        links=links,
        num_believed=_num_links(is_believed),
        num_working=_num_links(is_true),
    )


def _num_links(is_link: Bool[np.ndarray, "N N"]) -> int:
    """Count links, one for both directions."""
    return int(np.sum(np.triu(is_link | is_link.T)))


def by_kind(links: LinkRows) -> dict[LinkKind, LinkRows]:
    """Sort links: those that decode without belief, and believed ones that are too weak."""
    is_too_weak = links["is_too_weak"]
    # In the order of `palette.MISMATCH`: what is drawn first may be covered by what follows.
    return {"unbelieved": links[~is_too_weak], "too_weak": links[is_too_weak]}


def ends(links: LinkRows, position_m: Positions, row: int | Int[np.ndarray, "L"]) -> LinkLines:
    """Return where links begin and end, by the robots' positions in a window or each one's [m]."""
    start_m = position_m[row, links["sender"]]
    end_m = position_m[row, links["receiver"]]
    return np.stack([start_m, end_m], axis=1)


def divided(lines_m: LinkLines, pieces: Float[np.ndarray, "P 2"]) -> LinkLines:
    """Divide lines from start to end into pieces, as many of each [m]."""
    start_m, end_m = np.moveaxis(lines_m, 1, 0)
    way_m = end_m - start_m
    # [line, piece, its start or end, along which axis]
    along = pieces[None, :, :, None]
    ends_m = start_m[:, None, None, :] + along * way_m[:, None, None, :]
    return ends_m.reshape(-1, *lines_m.shape[1:])


def shades(kind: LinkKind, links: LinkRows) -> UInt8[np.ndarray, "L 3"]:
    """Return the colours of links of one kind: the lower the margin, the darker."""
    if kind != "too_weak":
        return np.tile(np.array(palette.MISMATCH[kind], dtype=np.uint8), (len(links), 1))
    shares = np.interp(links["margin_db"], [FAINTEST_DB, 0.0], [FAINTEST, BRIGHTEST])
    return (shares[:, None] * np.array(palette.TOO_WEAK)).astype(np.uint8)
