"""One mission's robots under self-organised TDMA, side by side: row i is robot i's memory."""

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.policies.sotdma.choices import Rule, chosen, first_slots
from swarm_mj.policies.sotdma.hearsay import (
    OF_NO_FRAME,
    Frames,
    Hearsay,
    is_in_need,
    nothing_heard,
    place_of,
    read_packets,
    read_slots,
    write_marks,
)
from swarm_mj.policies.sotdma.settings import SotdmaSettings
from swarm_mj.protocol.buffers import Buffers
from swarm_mj.protocol.window import SLOTS_PER_WINDOW
from swarm_mj.radio.link_models import Belief
from swarm_mj.radio.power_law import powers_between, write_powers


class Team:
    """Robots that choose their slots, each by its own beliefs."""

    def __init__(
        self, order: Int[np.ndarray, "N"], belief: Belief, settings: SotdmaSettings
    ) -> None:
        """Prepare the team.

        Args:
            order: In which robots choose.
            belief: What they believe of the channel.
            settings: What was tuned.
        """
        radio = belief.radio
        self._order = order
        self._settings = settings
        self._law = belief.law_over_noise(len(order))
        num_slots = settings.frame_slots(len(order))
        self._rule = Rule(
            threshold=radio.threshold,
            interference=settings.interference,
            num_slots=num_slots,
            frames=settings.simulated_frames,
            start_age=settings.start_frames * num_slots,
            least_gain=SLOTS_PER_WINDOW * settings.least_gain_windows,
        )
        self._frames: Frames | None = None  # known from the first decision on
        self._hearsay: Hearsay | None = None  # there is none before the first frame

    @property
    def takes_turns(self) -> bool:
        """Whether there was no frame so far."""
        return self._hearsay is None

    def transmits(
        self,
        slot: int,
        by_turns: Bool[np.ndarray, "N"],
        buffers: Buffers,
        b: int,
        heard: Int[np.ndarray, "N"],
        draw: Float[np.ndarray, "N"],
    ) -> Bool[np.ndarray, "N"]:
        """Who transmits in a slot.

        Args:
            slot: That begins; slots are asked for one after the other.
            by_turns: Who would transmit by the rule of the start.
            buffers: Of all missions.
            b: This one.
            heard: Whom each robot decoded in the last slot; itself is nobody.
            draw: One number on [0, 1) a robot, for contention.
        """
        if self._frames is None:
            first_slot = slot + self._settings.first_rounds * len(self._order)
            every = self._settings.contention_every
            self._frames = Frames(first_slot, self._rule.num_slots, every)
        frames, timestamp = self._frames, buffers.timestamp[b]
        if slot < frames.first_slot:
            return by_turns
        is_known = buffers.is_known[b] | np.eye(len(self._order), dtype=bool)
        if self._hearsay is None:
            self._hearsay = self._begin(buffers.position_m[b], is_known)
        hearsay = self._hearsay
        read_packets(hearsay, heard, timestamp, buffers.parent[b], slot - 1, frames)
        read_slots(hearsay, timestamp, frames)
        for i in self._choosers(slot, frames):
            chose_lately = self._chose_lately(slot, frames)
            powers = self._powers(buffers.position_m[b, i], is_known[i])
            hearsay.slots[i, i] = self._choose(i, slot, hearsay, is_known[i], chose_lately, powers)
        place = place_of(slot, frames)
        if place == OF_NO_FRAME:
            is_near = is_known & self._is_in_range(buffers.position_m[b])
            transmits = self._contends(slot, hearsay, is_near, timestamp, draw)
        else:
            transmits = np.diagonal(hearsay.slots) == place
        hearsay.sent[transmits], hearsay.sent_place[transmits] = slot, place
        return transmits

    def _begin(
        self, position_m: Float[np.ndarray, "N N 2"], is_known: Bool[np.ndarray, "N N"]
    ) -> Hearsay:
        """Everyone works out everyone's first slot; those who believe the same need it once."""
        slots = np.empty(is_known.shape, dtype=np.int64)
        done = {}
        for i in range(len(slots)):
            believed = position_m[i].tobytes(), is_known[i].tobytes()
            if believed not in done:
                power = self._powers(position_m[i], is_known[i])
                done[believed] = first_slots(self._order, is_known[i], power, self._rule)
            slots[i] = done[believed]
        return nothing_heard(slots, self._rule.num_slots)

    def _choosers(self, slot: int, frames: Frames) -> list[int]:
        """Who chooses anew in this slot: everyone once in some frames, in the common order."""
        period = self._settings.frames_per_choice * frames.num_slots
        since, num_robots = slot - frames.first_slot, len(self._order)
        if since < frames.num_slots:
            return []
        first, end = (-(-(since % period + n) * num_robots // period) for n in (0, 1))
        return self._order[first:end].tolist()

    def _chose_lately(self, slot: int, frames: Frames) -> Int[np.ndarray, "predicted 2"]:
        """Who chose in which slot, the earliest first."""
        lately = range(slot - self._settings.predicted_slots, slot)
        pairs = [(k, before) for before in lately for k in self._choosers(before, frames)]
        return np.array(pairs, dtype=np.int64).reshape(-1, 2)

    def _choose(
        self,
        i: int,
        slot: int,
        hearsay: Hearsay,
        is_known: Bool[np.ndarray, "N"],
        chose_lately: Int[np.ndarray, "predicted 2"],
        power: Float[np.ndarray, "N N"],
    ) -> int:
        """Return the slot that robot i chooses."""
        is_marked = np.empty(hearsay.missed.shape[1:], dtype=bool)
        write_marks(
            hearsay.missed[i],
            hearsay.missed_at[i],
            hearsay.share[i],
            self._settings.least_doubt,
            slot - self._settings.marked_slots,
            is_marked,
        )
        slots, announced = hearsay.slots[i], hearsay.announced[i]
        return chosen(i, slots, announced, is_known, is_marked, chose_lately, power, self._rule)

    def _contends(
        self,
        slot: int,
        hearsay: Hearsay,
        is_near: Bool[np.ndarray, "N N"],
        timestamp: Float[np.ndarray, "N N"],
        draw: Float[np.ndarray, "N"],
    ) -> Bool[np.ndarray, "N"]:
        """Who transmits in a slot of no frame: robots in need, by chance."""
        patience = self._settings.need_frames * self._rule.num_slots
        resignation = self._settings.lost_frames * self._rule.num_slots
        transmits = draw < self._settings.contention_probability
        for i in np.flatnonzero(transmits).tolist():
            transmits[i] = is_in_need(
                hearsay, i, timestamp[i], is_near[i], slot, patience, resignation
            )
        return transmits

    def _is_in_range(self, position_m: Float[np.ndarray, "N N 2"]) -> Bool[np.ndarray, "N N"]:
        """Who decodes each robot's lone packets, as it believes."""
        power = np.empty(position_m.shape[:2])
        for i in range(len(power)):
            write_powers(i, position_m[i], self._law, power[i])
        return power >= self._rule.threshold

    def _powers(
        self, position_m: Float[np.ndarray, "N 2"], is_known: Bool[np.ndarray, "N"]
    ) -> Float[np.ndarray, "N N"]:
        """Of everyone at everyone, as one robot believes; of those that it knows [noise]."""
        return powers_between(position_m, self._law) * is_known[:, None] * is_known[None, :]
