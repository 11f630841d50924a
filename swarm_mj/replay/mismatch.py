"""Links on which the channel and what policies believe of it differ, and who is cut off.

Policies believe in mean powers: a lone packet decodes if its mean power is above the threshold. The
fading and losses of single packets are therefore no mismatch.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float, Int, Int16, Shaped, UInt8

from swarm_mj.radio.composed import ComposedChannel, strong_groups
from swarm_mj.radio.mission_radio import by_robot, radio_of
from swarm_mj.replay import palette
from swarm_mj.replay.packets import Positions
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

# A link that is believed in but too weak to decode, or decodes although policies do not believe in
# it; once for both directions. `loss_db` is between the antennas, `margin_db` of the mean power
# over what decodes. Files keep these four numbers.
NUMBERS = ("sender", "receiver", "loss_db", "margin_db")
LINK = np.dtype([("row", int), *((name, np.int16) for name in NUMBERS), ("is_too_weak", bool)])


Links: TypeAlias = Shaped[np.ndarray, "_"]  # an array of `LINK`
Lines: TypeAlias = Float[np.ndarray, "_ 2 2"]  # from start to end [m]


class LinkMismatch(NamedTuple):
    """The L links that differ in C snapshots, each of which stands until the next."""

    window: Int[np.ndarray, "C"]  # of each snapshot; 1 is the mission's first
    links: Links  # with the row of their snapshot, ascending

    def at(self, window: int) -> Links:
        """Return the links of the snapshot that stands for a window."""
        row = np.searchsorted(self.window, window, side="right") - 1
        return self.links[self.links["row"] == row]


NO_MISMATCH = LinkMismatch(np.zeros(0, dtype=int), np.zeros(0, LINK))


class RadioSnapshot(NamedTuple):
    """The mean links of one mission at one moment."""

    group: Int16[np.ndarray, "N"]  # the first of the robots that each is connected with
    links: Links  # that differ
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
    differs = is_true != is_believed
    differs &= ~np.tril(differs.T)  # the other direction stands for both
    links = np.zeros(int(np.sum(differs)), LINK)
    links["sender"], links["receiver"] = np.nonzero(differs)
    links["is_too_weak"] = is_believed[differs]
    power_mw = np.maximum(true_mw[differs], np.finfo(float).tiny)
    sent_mw = by_robot(mission, radio_of(mission).power_mw)[links["sender"]]
    links["loss_db"] = np.round(10.0 * np.log10(sent_mw / power_mw))
    # Rounded down: a packet that does not decode must not show a margin of 0 dB.
    links["margin_db"] = np.floor(10.0 * np.log10(power_mw / min_mw))
    num_believed, num_working = (int(np.sum(np.triu(x | x.T))) for x in (is_believed, is_true))
    group = strong_groups(is_true).astype(np.int16)
    return RadioSnapshot(group, links, num_believed, num_working)


def by_kind(links: Links) -> dict[str, Links]:
    """Sort links: those that decode without belief, and believed ones that are too weak."""
    return {kind: links[links["is_too_weak"] == (kind == "too_weak")] for kind in palette.MISMATCH}


def ends(links: Links, position_m: Positions, row: int | Int[np.ndarray, "L"]) -> Lines:
    """Return where links begin and end, by the robots' positions in a window or each one's [m]."""
    return np.stack([position_m[row, links[end]] for end in NUMBERS[:2]], axis=1)


def divided(lines_m: Lines, pieces: Float[np.ndarray, "P 2"]) -> Lines:
    """Divide lines from start to end into pieces, as many of each [m]."""
    start_m, way_m = lines_m[:, None, None, 0], np.diff(lines_m, axis=1)[:, None]
    return (start_m + pieces[None, :, :, None] * way_m).reshape(-1, 2, 2)


def shades(kind: str, links: Links) -> UInt8[np.ndarray, "L 3"]:
    """Return the colours of links of one kind: the lower the margin, the darker."""
    if kind != "too_weak":
        return np.tile(np.array(palette.MISMATCH[kind], dtype=np.uint8), (len(links), 1))
    shares = np.interp(links["margin_db"], [FAINTEST_DB, 0.0], [FAINTEST, BRIGHTEST])
    return (shares[:, None] * np.array(palette.TOO_WEAK)).astype(np.uint8)
