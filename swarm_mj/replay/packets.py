"""Packets of recorded windows: what became of each, and where it is drawn."""

from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.replay import palette

Phases: TypeAlias = Int[np.ndarray, "T 2 N"]  # a robot for each one in both phases of windows
Positions: TypeAlias = Float[np.ndarray, "T N 2"]  # of all robots in each window [m]
Points: TypeAlias = Float[np.ndarray, "L 2"]  # an end of each packet [m]

SEGMENTS = 6  # straight pieces of an arc
RISE = 0.22  # of an arc's top, by its span


class PacketLinks(NamedTuple):
    """L packets with the same fate, sorted by window."""

    row: Int[np.ndarray, "L"]  # the window, 0 to T - 1
    sender: Int[np.ndarray, "L"]
    receiver: Int[np.ndarray, "L"]

    def chosen(self, which: Bool[np.ndarray, "L"]) -> "PacketLinks":
        """Return some of the packets."""
        return PacketLinks(*(column[which] for column in self))

    def ends(self, position_m: Positions) -> tuple[Points, Points]:
        """Return the positions of the senders and of the receivers [m]."""
        return position_m[self.row, self.sender], position_m[self.row, self.receiver]


class PacketSegments(NamedTuple):
    """L packets with the same fate as they are drawn, sorted by window."""

    row: Int[np.ndarray, "L"]
    start_m: Points
    end_m: Points


def fates(recipient: Phases, heard: Phases, *, is_broadcast: bool) -> dict[str, PacketLinks]:
    """Sort the packets of T windows by their fate.

    Addressed packets are delivered, lost, overheard, answered or unanswered. `lost` and
    `unanswered` ones end at the robot they were meant for, which did not decode them; a packet that
    k other robots overheard is k links. Broadcasts have no addressee: `heard` leads to each hearer.
    The second phase answers the first. `recipient` is S^i in both phases, `heard` the sender that
    each robot decoded; a robot's own number is none.
    """
    # A robot decodes at most one packet in a phase, so `heard` has every reception once.
    row, phase, hearer = np.nonzero(is_other(heard))
    speaker = heard[row, phase, hearer]
    received = PacketLinks(row, speaker, hearer)
    if is_broadcast:
        return {"heard": received}
    is_overheard = recipient[row, phase, speaker] != hearer
    row, phase, sender = np.nonzero(is_other(recipient))
    receiver = recipient[row, phase, sender]
    is_decoded, is_request = heard[row, phase, receiver] == sender, phase == 0
    sent = PacketLinks(row, sender, receiver)
    return {
        "delivered": sent.chosen(is_request & is_decoded),
        "lost": sent.chosen(is_request & ~is_decoded),
        "overheard": received.chosen(is_overheard),
        "answered": sent.chosen(~is_request & is_decoded),
        "unanswered": sent.chosen(~is_request & ~is_decoded),
    }


def is_other(robot: Phases) -> Bool[np.ndarray, "T 2 N"]:
    """Tell where a robot addresses, or decodes, another one."""
    return robot != np.arange(robot.shape[2])


def packet_segments(
    packets: dict[str, PacketLinks], position_m: Positions
) -> dict[str, PacketSegments]:
    """Return where packets are drawn, in the order of drawing; lost ones stop on their way."""
    segments = {}
    for fate in (fate for fate in palette.PACKETS if fate in packets):
        start_m, end_m = packets[fate].ends(position_m)
        end_m = start_m + palette.PACKETS[fate][1] * (end_m - start_m)
        segments[fate] = PacketSegments(packets[fate].row, start_m, end_m)
    return segments


def lifted(at_m: Float[np.ndarray, "*S 2"], height_m: float) -> Float[np.ndarray, "*S 3"]:
    """Return points at a height above the ground [m]."""
    width = [(0, 0)] * (at_m.ndim - 1) + [(0, 1)]
    return np.pad(at_m, width, constant_values=height_m)


def arcs(start_m: Points, end_m: Points, base_m: float) -> Float[np.ndarray, "L P 3"]:
    """Return points along parabolas that start and end at `base_m` above the ground [m]."""
    share = np.linspace(0.0, 1.0, SEGMENTS + 1)
    span_m = np.linalg.norm(end_m - start_m, axis=1)
    # The longer the higher: packets that cross on the ground stay apart in the picture.
    height_m = base_m + 4.0 * RISE * span_m[:, None] * share * (1.0 - share)
    ground_m = start_m[:, None] + share[:, None] * (end_m - start_m)[:, None]
    return np.concatenate([ground_m, height_m[..., None]], axis=2)
