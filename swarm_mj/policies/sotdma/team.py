"""One mission's robots under self-organised TDMA, side by side: row i is robot i's memory."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.policies.sotdma.frame import Rule, chosen, first_slots
from swarm_mj.policies.sotdma.slot_table import (
    NO_PLACE,
    Frames,
    SlotTable,
    is_in_need,
    marks,
    place_of,
    read_packets,
    read_slots,
    slot_table,
)
from swarm_mj.protocol.buffers import Buffers
from swarm_mj.protocol.window import SLOTS_PER_WINDOW
from swarm_mj.radio.mission_radio import Belief
from swarm_mj.radio.power_law import powers_between, write_powers


@dataclass(frozen=True, kw_only=True)
class SotdmaSettings:
    """All numbers that were chosen by trial, of frames and of how robots choose their slots.

    Each is the best of a few that were tried on 8 to 12 missions of 300 windows with seeds from
    1000, mostly of 40 robots, at rest and walking (`training/RESULTS.md`). A round is N slots.
    """

    slots_per_root: float = 3.2  # a frame's slots, over the square root of N
    first_rounds: int = 3  # of spatial TDMA, before the first frame [rounds]
    frames_per_choice: int = 4  # in which everyone chooses anew once [frames]
    simulated_frames: int = 4  # in a choice; the last one counts [frames]
    start_frames: float = 6.0  # age of all information when that begins [frames]
    min_gain_windows: float = 0.1  # of mean age, that a new slot must be better by [windows]
    interference: float = 1.2  # times what robots believe of it: choices at the edge fail
    predicted_slots: int = 48  # for which choices of unheard robots are predicted [slots]
    marked_slots: int = 200  # for which a slot that a neighbour missed is marked [slots]
    min_miss_probability: float = 0.1  # rarer misses mark a slot, as no chance
    contention_every: int = 16  # the last of this many slots is no part of the frames [slots]
    contention_probability: float = 0.4  # that a robot in need transmits in it [1]
    need_frames: float = 3.0  # a neighbour not heard for longer is lost [frames]
    lost_frames: float = 12.0  # and one not heard for even longer is gone [frames]

    def frame_slots(self, num_robots: int) -> int:
        """Return how many slots a team's frames have."""
        return max(2, min(num_robots, round(self.slots_per_root * math.sqrt(num_robots))))


class SotdmaTeam:
    """Robots that choose their slots, each by its own beliefs."""

    def __init__(
        self, order: Int[np.ndarray, "N"], belief: Belief, settings: SotdmaSettings
    ) -> None:
        """Prepare the team, whose robots choose in this order."""
        self._order = order
        self._settings = settings
        self._law = belief.law_over_noise(len(order))
        num_slots = settings.frame_slots(len(order))
        self._rule = Rule(
            threshold=belief.radio.threshold,
            interference=settings.interference,
            num_slots=num_slots,
            frames=settings.simulated_frames,
            start_age=settings.start_frames * num_slots,
            min_gain=SLOTS_PER_WINDOW * settings.min_gain_windows,
        )
        self._frames: Frames | None = None  # known from the first decision on
        self._table: SlotTable | None = None  # there is none before the first frame

    @property
    def takes_turns(self) -> bool:
        """True before the first frame."""
        return self._table is None

    def transmits(
        self,
        slot: int,
        in_turn: Bool[np.ndarray, "N"],
        buffers: Buffers,
        b: int,
        heard: Int[np.ndarray, "N"],
        draw: Float[np.ndarray, "N"],
    ) -> Bool[np.ndarray, "N"]:
        """Return who transmits in the slot that begins in mission b; ask slot by slot.

        Before the first frame these are the robots in turn. `heard` is the sender that each robot
        decoded in the last slot, itself: none; `draw` is on [0, 1), for contention.
        """
        settings = self._settings
        if self._frames is None:
            first_slot = slot + settings.first_rounds * len(self._order)
            self._frames = Frames(first_slot, self._rule.num_slots, settings.contention_every)
        frames, timestamp = self._frames, buffers.timestamp[b]
        if slot < frames.first_slot:
            return in_turn
        is_known = buffers.is_known[b] | np.eye(len(self._order), dtype=bool)
        if self._table is None:
            slots = self._first_slots(buffers.position_m[b], is_known)
            self._table = slot_table(slots, self._rule.num_slots)
        table = self._table
        read_packets(table, heard, timestamp, buffers.parent[b], slot - 1, frames)
        read_slots(table, timestamp, frames)
        for i in self._choosers(slot, frames):
            table.slots[i, i] = chosen(
                i,
                table.slots[i],
                table.announced[i],
                is_known[i],
                marks(table, i, settings.min_miss_probability, slot - settings.marked_slots),
                self._chose_lately(slot, frames),
                self._powers(buffers.position_m[b, i], is_known[i]),
                self._rule,
            )
        place = place_of(slot, frames)
        if place == NO_PLACE:
            is_near = is_known & self._is_in_range(buffers.position_m[b])
            transmits = self._contends(slot, table, is_near, timestamp, draw)
        else:
            transmits = np.diagonal(table.slots) == place
        table.sent[transmits], table.sent_place[transmits] = slot, place
        return transmits

    def _first_slots(
        self, position_m: Float[np.ndarray, "N N 2"], is_known: Bool[np.ndarray, "N N"]
    ) -> Int[np.ndarray, "N N"]:
        """Return everyone's first slots as each robot works them out."""
        slots = np.empty(is_known.shape, dtype=np.int64)
        done = {}  # robots that believe the same need it once
        for i in range(len(slots)):
            believed = position_m[i].tobytes(), is_known[i].tobytes()
            if believed not in done:
                power = self._powers(position_m[i], is_known[i])
                done[believed] = first_slots(self._order, is_known[i], power, self._rule)
            slots[i] = done[believed]
        return slots

    def _choosers(self, slot: int, frames: Frames) -> list[int]:
        """Return who chooses anew in this slot: everyone once in some frames, in common order."""
        period = self._settings.frames_per_choice * frames.num_slots
        since, num_robots = slot - frames.first_slot, len(self._order)
        if since < frames.num_slots:  # nobody has heard how the first slots do
            return []
        first, end = (-(-(since % period + n) * num_robots // period) for n in (0, 1))
        return self._order[first:end].tolist()

    def _chose_lately(self, slot: int, frames: Frames) -> Int[np.ndarray, "predicted 2"]:
        """Return who chose in which slot, the earliest first."""
        lately = range(slot - self._settings.predicted_slots, slot)
        pairs = [(k, before) for before in lately for k in self._choosers(before, frames)]
        return np.array(pairs, dtype=np.int64).reshape(-1, 2)

    def _contends(
        self,
        slot: int,
        table: SlotTable,
        is_near: Bool[np.ndarray, "N N"],
        timestamp: Float[np.ndarray, "N N"],
        draw: Float[np.ndarray, "N"],
    ) -> Bool[np.ndarray, "N"]:
        """Return who transmits in a slot of no frame: robots in need, by chance."""
        patience = self._settings.need_frames * self._rule.num_slots
        resignation = self._settings.lost_frames * self._rule.num_slots
        transmits = draw < self._settings.contention_probability
        for i in np.flatnonzero(transmits).tolist():
            transmits[i] = is_in_need(
                table, i, timestamp[i], is_near[i], slot, patience, resignation
            )
        return transmits

    def _is_in_range(self, position_m: Float[np.ndarray, "N N 2"]) -> Bool[np.ndarray, "N N"]:
        """Return who decodes each robot's lone packets, as it believes."""
        power = np.empty(position_m.shape[:2])
        for i in range(len(power)):
            write_powers(i, position_m[i], self._law, power[i])
        return power >= self._rule.threshold

    def _powers(
        self, position_m: Float[np.ndarray, "N 2"], is_known: Bool[np.ndarray, "N"]
    ) -> Float[np.ndarray, "N N"]:
        """Return powers between robots that one robot knows, as it believes [noise]."""
        return powers_between(position_m, self._law) * is_known[:, None] * is_known[None, :]
