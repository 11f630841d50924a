"""The flight that an export writes: where the robots were, their packets slot by slot, and ages."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.protocol.buffers import BROADCAST
from swarm_mj.protocol.timestamps import SLOT_WINDOWS, SLOTS_PER_WINDOW
from swarm_mj.replay.footage import Footage
from swarm_mj.replay.links import lifted
from swarm_mj.replay.log import REQUEST

DIGITS = 6  # after the point, of metres, seconds and windows: replays keep less

# What became of a packet. A request is delivered to its recipient or lost, and a response is
# answered or unanswered: decoded by the robot that asked, or not. A broadcast is heard by at least
# one robot, or unheard.
PacketFate: TypeAlias = Literal["delivered", "lost", "answered", "unanswered", "heard", "unheard"]


class SentPacket(NamedTuple):
    """One packet: who sent it to whom, when, and who decoded it."""

    slot: int  # 0 or 1, of its window
    begin_s: float  # when its slot begins
    sender: int
    recipient: int | None  # None: everyone
    fate: PacketFate
    receivers: list[int]  # that decoded it, ascending


class TeamAges(NamedTuple):
    """Ages at the end of one window [windows]; None is what is not known."""

    mean: float | None  # over all pairs of robots
    std: float | None
    worst: float | None  # of a pair
    known: list[float | None]  # of what the observer knows about each robot


@dataclass(frozen=True, kw_only=True)
class FlownWindows:
    """T windows of N robots, as a replay keeps them.

    In each window the robots first move and then talk over two slots, so they are where the window
    shows them from its beginning on. Ages are those at its end.
    """

    footage: Footage
    recipient: Int[np.ndarray, "T 2 N"]  # whom each robot addressed in both slots; itself: silent
    heard: Int[np.ndarray, "T 2 N"]  # whom each robot decoded; itself: nobody
    age_std: Float[np.ndarray, "T"]  # over all pairs of robots [windows]
    age_worst: Float[np.ndarray, "T"]  # the worst pair's [windows]

    @property
    def num_robots(self) -> int:
        """The size of the team."""
        return self.recipient.shape[2]

    @property
    def window_s(self) -> float:
        """The length of a window [s]."""
        return self.footage.facts.mission.window_s

    def begin_s(self, row: int, slot: int = REQUEST) -> float:
        """Return when a slot of a window begins, by the mission's time [s]."""
        windows_before = int(self.footage.window[row]) - 1
        return round((windows_before + slot * SLOT_WINDOWS) * self.window_s, DIGITS)

    def end_s(self, row: int) -> float:
        """Return when a window ends, by the mission's time [s]."""
        return round(int(self.footage.window[row]) * self.window_s, DIGITS)

    @property
    def has_bodies(self) -> bool:
        """True if robots have heights; points are all at 0 m."""
        return self.footage.height_m is not None

    @cached_property
    def place_m(self) -> Float[np.ndarray, "T N 3"]:
        """Where robots are in space [m]."""
        return lifted(self.footage.position_m, self.footage.above(0.0))

    def velocity_mps(self, row: int) -> Float[np.ndarray, "N 3"]:
        """Return the way since the window before over its time [m/s]; nan in the first window."""
        # Replays draw headings, all of one length, and keep no speeds.
        if row == 0:
            return np.full_like(self.place_m[row], np.nan)
        return (self.place_m[row] - self.place_m[row - 1]) / self.window_s

    def packets(self, row: int) -> Iterator[SentPacket]:
        """Yield the packets of a window, in the order of slots and senders."""
        robots = np.arange(self.num_robots)
        for slot in range(SLOTS_PER_WINDOW):
            recipient = self.recipient[row, slot]
            for sender in np.flatnonzero(recipient != robots).tolist():
                receivers = self._receivers(SLOTS_PER_WINDOW * row + slot, sender)
                to = int(recipient[sender])
                yield SentPacket(
                    slot=slot,
                    begin_s=self.begin_s(row, slot),
                    sender=sender,
                    recipient=None if to == BROADCAST else to,
                    fate=self._fate(slot, to, receivers),
                    receivers=receivers,
                )

    def _receivers(self, k: int, sender: int) -> list[int]:
        """Return who decoded the packet that a robot sent in slot k of the mission, from 0."""
        recipient = self.recipient.reshape(-1, self.num_robots)
        heard = self.heard.reshape(-1, self.num_robots)
        received = heard[k] == sender
        # Where clocks differ, a late packet counts as decoded in the next slot. Replays do not keep
        # who was late, so what is decoded there is the sender's packet of that slot, if it has one.
        after = k + 1
        if after < len(heard) and recipient[after, sender] == sender:
            received |= heard[after] == sender
        received[sender] = False  # its own number is nobody
        return np.flatnonzero(received).tolist()

    def _fate(self, slot: int, recipient: int, receivers: list[int]) -> PacketFate:
        if self.footage.facts.is_broadcast:
            return "heard" if receivers else "unheard"
        is_decoded = recipient in receivers
        if slot == REQUEST:
            return "delivered" if is_decoded else "lost"
        return "answered" if is_decoded else "unanswered"

    def ages(self, row: int) -> TeamAges:
        """Return the ages at the end of a window."""
        return TeamAges(
            mean=number(self.footage.age_mean[row]),
            std=number(self.age_std[row]),
            worst=number(self.age_worst[row]),
            known=[number(age) for age in self.footage.known_age[row]],
        )


def number(value: float) -> float | None:
    """Return a number as files have it; None, where it is not known (nan)."""
    return None if np.isnan(value) else round(float(value), DIGITS)
