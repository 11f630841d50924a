"""Links on which the channel and what policies believe of it differ, and who is cut off.

Policies believe in mean powers: a lone packet decodes if its mean power is above the threshold. The
fading and losses of single packets are therefore no mismatch.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int, Int16, UInt8

from swarm_mj.radio.composed import ComposedChannel, strong_groups
from swarm_mj.radio.mission_radio import by_robot, radio_of
from swarm_mj.replay import palette
from swarm_mj.simulation.swarm import Swarm

EVERY = 5  # windows between snapshots; in between, the last one is shown
WAY_SHARE = 0.005  # of the area's side, that robots may fly between snapshots

# Pieces that a line is drawn in, from where to where [of its length]: the dashes of a link that is
# too weak cover DASH of the way to the next one's start.
WHOLE = np.array([[0.0, 1.0]])
NUM_DASHES, DASH = 4, 0.6
DASHES = (np.arange(NUM_DASHES)[:, None] + [0.0, DASH]) / (NUM_DASHES - 1 + DASH)
PIECES = {"unbelieved": WHOLE, "too_weak": DASHES}
FAINTEST, FAINTEST_DB = 0.5, -30.0  # the shade of a link that misses this margin or more
BRIGHTEST = 0.85  # of one that is hardly too weak


@dataclass(frozen=True, kw_only=True)
class LinkMismatch:
    """L links on which channel and belief differ, seen in C snapshots.

    They are believed in but too weak to decode, or decode although policies do not believe in them.
    A link that differs in both directions stands once.
    """

    window: Int[np.ndarray, "C"]  # of each snapshot, which stands until the next; 1 is the first
    row: Int[np.ndarray, "L"]  # the link's snapshot, 0 to C - 1, ascending
    sender: Int16[np.ndarray, "L"]
    receiver: Int16[np.ndarray, "L"]
    is_too_weak: Bool[np.ndarray, "L"]
    loss_db: Int16[np.ndarray, "L"]  # between the two antennas [dB]
    margin_db: Int16[np.ndarray, "L"]  # of the mean power over what decodes [dB]

    @property
    def by_kind(self) -> dict[str, "LinkMismatch"]:
        """Links that decode without belief, and believed ones that are too weak."""
        is_of = {"unbelieved": ~self.is_too_weak, "too_weak": self.is_too_weak}
        return {kind: self.chosen(is_of[kind]) for kind in palette.MISMATCH}

    def chosen(self, which: Bool[np.ndarray, "L"] | Int[np.ndarray, "K"] | slice) -> "LinkMismatch":
        """Return some of the links."""
        return replace(self, **{name: getattr(self, name)[which] for name in PER_LINK})

    def at(self, window: int) -> "LinkMismatch":
        """Return the links of the snapshot that stands for a window."""
        row = np.searchsorted(self.window, window, side="right") - 1
        first, last = np.searchsorted(self.row, [row, row + 1])
        return self.chosen(np.s_[first:last])

    def of_robot(self, i: int) -> Bool[np.ndarray, "L"]:
        """Tell which links begin or end at a robot."""
        return (self.sender == i) | (self.receiver == i)


PER_LINK = ("row", "sender", "receiver", "is_too_weak", "loss_db", "margin_db")


@dataclass(frozen=True, kw_only=True)
class RadioSnapshot:
    """The mean links of one mission at one moment."""

    group: Int16[np.ndarray, "N"]  # the first of the robots that each is connected with
    mismatch: LinkMismatch  # of this snapshot alone
    num_believed: int  # links that are believed in, one for both directions
    num_working: int  # links that decode, likewise


def stride_of(swarm: Swarm, min_stride: int = 1) -> int:
    """Return the windows between snapshots: so few that robots hardly move, but not fewer."""
    mission = swarm.mission
    way_m = mission.max_velocity_mps * mission.window_s
    return max(1, min_stride, min(EVERY, int(WAY_SHARE * mission.side_m / way_m)))


def radio_snapshot(swarm: Swarm, index: int = 0) -> RadioSnapshot | None:
    """Compare one mission's channel with the belief about it.

    There is nothing to compare in free space, where the belief is right, and in a user's own
    channel, whose mean powers are unknown.
    """
    channel = swarm.channel
    if not isinstance(channel, ComposedChannel):
        return None
    mission, position_m = swarm.mission, swarm.states.position_m[index]
    true_mw = channel.mean_powers_mw(position_m, index)
    believed_mw = swarm.belief.links(position_m).received_mw
    min_mw = channel.reception.noise_mw * channel.reception.threshold
    is_on = swarm.states.is_active
    here = np.ones(mission.num_robots, dtype=bool) if is_on is None else is_on[index]
    pairs = here[:, None] & here & ~np.eye(mission.num_robots, dtype=bool)
    is_true, is_believed = (pairs & (power >= min_mw) for power in (true_mw, believed_mw))
    sent_mw = by_robot(mission, radio_of(mission).power_mw)
    differs = is_true != is_believed
    differs &= ~np.tril(differs.T)  # the other direction stands for both
    sender, receiver = np.nonzero(differs)
    power_mw = np.maximum(true_mw[sender, receiver], np.finfo(float).tiny)
    num_believed, num_working = (int(np.sum(np.triu(x | x.T))) for x in (is_believed, is_true))
    mismatch = LinkMismatch(
        window=np.array([1]),
        row=np.zeros(len(sender), dtype=int),
        sender=sender.astype(np.int16),
        receiver=receiver.astype(np.int16),
        is_too_weak=is_believed[sender, receiver],
        loss_db=np.round(10.0 * np.log10(sent_mw[sender] / power_mw)).astype(np.int16),
        # Rounded down: a packet that does not decode must not show a margin of 0 dB.
        margin_db=np.floor(10.0 * np.log10(power_mw / min_mw)).astype(np.int16),
    )
    group = strong_groups(is_true).astype(np.int16)
    return RadioSnapshot(
        group=group, mismatch=mismatch, num_believed=num_believed, num_working=num_working
    )


def joined(each: Sequence[LinkMismatch], window: Int[np.ndarray, "C"]) -> LinkMismatch:
    """Join the snapshots of these windows."""
    row = np.repeat(np.arange(len(each)), [len(one.row) for one in each])
    return replace(_together(each), window=window, row=row)


def by_row(kinds: Sequence[LinkMismatch]) -> LinkMismatch:
    """Join links of several kinds from the same snapshots."""
    found = _together(kinds)
    return found.chosen(np.argsort(found.row, kind="stable"))


def mismatch_lines(
    links: LinkMismatch,
    position_m: Float[np.ndarray, "C N 2"],
    pieces: Float[np.ndarray, "P 2"] = WHOLE,
) -> tuple[Float[np.ndarray, "S 2 2"], Int[np.ndarray, "S"]]:
    """Return lines from start to end [m], and the link of each, which is drawn in `pieces`."""
    start_m = position_m[links.row, links.sender]
    end_m = position_m[links.row, links.receiver]
    way_m = (end_m - start_m)[:, None, None]
    pieces_m = start_m[:, None, None] + pieces[None, :, :, None] * way_m
    return pieces_m.reshape(-1, 2, 2), np.repeat(np.arange(len(links.row)), len(pieces))


def shades(kind: str, links: LinkMismatch) -> UInt8[np.ndarray, "L 3"]:
    """Return the colours of links of one kind: the lower the margin, the darker."""
    if kind != "too_weak":
        return np.tile(np.array(palette.MISMATCH[kind], dtype=np.uint8), (len(links.row), 1))
    shares = np.interp(links.margin_db, [FAINTEST_DB, 0.0], [FAINTEST, BRIGHTEST])
    return (shares[:, None] * np.array(palette.TOO_WEAK)).astype(np.uint8)


def coloured_lines(
    links: LinkMismatch | None, position_m: Float[np.ndarray, "N 2"], observer: int
) -> tuple[Float[np.ndarray, "S 2 2"], UInt8[np.ndarray, "S 3"]]:
    """Return one snapshot's lines [m] and colours; of links too weak, only the observer's.

    In a city, all of them together would not show which robots each one joins.
    """
    if links is None:
        return np.zeros((0, 2, 2)), np.zeros((0, 3), dtype=np.uint8)
    links = links.chosen(links.of_robot(observer) | ~links.is_too_weak)
    links = replace(links, row=np.zeros_like(links.row))
    lines, colours = [], []
    for kind, found in links.by_kind.items():
        lines_m, link = mismatch_lines(found, position_m[None], PIECES[kind])
        lines.append(lines_m)
        colours.append(shades(kind, found)[link])
    return np.concatenate(lines), np.concatenate(colours)


def _together(parts: Sequence[LinkMismatch]) -> LinkMismatch:
    columns = {name: [getattr(part, name) for part in parts] for name in PER_LINK}
    return replace(parts[0], **{name: np.concatenate(each) for name, each in columns.items()})
