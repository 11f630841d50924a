"""`index-csma`: robots that listen before they transmit, in the order of a learned index."""

import hashlib
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.policies.about import Information, Leading, Listed, Look, PairMemory
from swarm_mj.policies.carrier_sense import (
    SENSING_MEMORY,
    SensingPolicy,
    covered_share,
    in_turn,
    turn_at,
)
from swarm_mj.policies.index.decisions import decide, empty_record
from swarm_mj.policies.index.shipped import shipped_weights
from swarm_mj.policies.index.table import MAX_ROWS, empty_gain, empty_table, note_and_weigh
from swarm_mj.policies.index.weights import NUM_SHIFTS, Weights, flat, repeated
from swarm_mj.policies.learned import DIGITS
from swarm_mj.policies.policy import Parameters
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.partial_buffers import choose_entries
from swarm_mj.protocol.timestamps import slot_at
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.carrier_sensing import Contention, usual_busy_dbm

# T before a slot, T in the packets of two slots and in the last own one, the number of a robot's
# row, and the rows.
TABLE_BYTES = 8.0 + 2 * 4.0 + 4.0 + 1.0 + 4.0 * MAX_ROWS


class IndexCsma(SensingPolicy):
    """CSMA in which a learned index says who goes first.

    Each robot keeps a table of what its neighbours know at least. So it knows about what its next
    packet would bring them, its gain. The gain and ten features of its situation, each with a
    learned weight, make the index: robots with a higher one begin earlier. Other weights of the
    same features say with how little gain a robot is silent, and how loud a channel may be for it.
    """

    NAME: ClassVar = "index-csma"
    about = Listed(
        name=NAME,
        origin=Leading(over=("age-gain-csma",)),
        rank=65,
        uses=(
            "its buffer, T in the packets that it sends and decodes, the power that it senses "
            "before it transmits, the clock, its identity, the size of the team and the radio's "
            "range, by learned numbers"
        ),
        beyond=(
            Information.COMMON_ORDER,
            Information.CLOCK,
            Information.TEAM_SIZE,
            Information.OBSERVED_POSITIONS,
            Information.RADIO_CONSTANTS,
            Information.ACKNOWLEDGEMENTS,
            Information.CARRIER_SENSING,
            Information.DECODED_PACKETS,
        ),
        payload=None,
        look=Look(label="index-csma", colour="#bb0088", marker="X"),
        memory=PairMemory(bytes_per_pair=SENSING_MEMORY.bytes_per_pair + TABLE_BYTES),
    )

    @classmethod
    def for_mission(cls, mission: Mission) -> "IndexCsma":
        """Return the policy for a mission, with the numbers that come with the package."""
        return cls(mission, shipped_weights())

    def __init__(self, mission: Mission, weights: Weights) -> None:
        """Prepare the policy for the mission's radio.

        Args:
            mission: What is flown.
            weights: The learned numbers: a row for all missions that are flown side by side, or
                several, each for as many of them, one after the other.
        """
        self._weights = weights
        self._range_m = mission.range_m
        self._num_minislots = mission.minislots
        self._busy_dbm = usual_busy_dbm(mission)
        self._num_entries = self.packet(mission).num_entries

    @property
    def parameters(self) -> Parameters:
        """A digest that changes with the numbers."""
        numbers = flat(self._weights).tobytes()
        return {"digest": hashlib.sha256(numbers).hexdigest()[:DIGITS]}

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Forget all packets and neighbours; arguments as in `Policy.start`."""
        shape = len(rngs), num_robots
        pairs = (*shape, num_robots)
        self._uniform = Stream(rngs, uniform, (2, num_robots))
        self._its = repeated(self._weights, len(rngs))
        self._table = empty_table(*shape)
        self._gain = empty_gain(*shape)
        self._record = empty_record(*shape)
        self._before = np.full(pairs, NEVER)  # T when the robots were last asked [windows]
        # T in the packets of the last slot and the one before [windows].
        self._packet = np.zeros(pairs, dtype=np.float32)
        self._earlier = np.zeros(pairs, dtype=np.float32)
        # T as last sent, where packets have no room for all entries.
        is_partial = self._num_entries < num_robots
        self._last_sent = np.full(pairs, NEVER) if is_partial else None

    def contend(self, views: LocalViews) -> Contention:
        """Return an earlier minislot the higher a robot's index; with too little gain it has none.

        A robot that has sent nothing yet is not silent.
        """
        slot = slot_at(views.now[0])  # the clocks of all missions are alike
        contention = self._by_index(views, slot)
        turn = turn_at(slot)
        return contention if turn is None else in_turn(views, turn)

    def _by_index(self, views: LocalViews, slot: int) -> Contention:
        """Note the slot that has ended, and return the contention of one that is no turn."""
        silence = views.silence
        heard = views.last_heard
        recipient = views.last_recipient
        has_sent = recipient != silence
        self._follow_packets(views, recipient)
        buffers = views.buffers
        note_and_weigh(
            table=self._table,
            gain=self._gain,
            timestamp=buffers.timestamp,
            is_known=buffers.is_known,
            position_m=buffers.position_m,
            now=views.now,
            heard=heard,
            has_sent=has_sent,
            packet=self._packet,
            earlier=self._earlier,
            range_m=self._range_m,
            weights=self._its,
        )
        begin_draw, silence_draw = self._uniform.next().swapaxes(0, 1)
        share = np.empty(silence.shape)
        shift_db = np.empty(silence.shape)
        decide(
            record=self._record,
            gain=self._gain,
            weights=self._its,
            timestamp=buffers.timestamp,
            now=views.now,
            has_sent=has_sent,
            has_decoded=heard != silence,
            covered=covered_share(views, self._range_m),
            begin_draw=begin_draw,
            silence_draw=silence_draw,
            phase=slot % NUM_SHIFTS,
            share=share,
            shift_db=shift_db,
        )
        minislot = np.floor(self._num_minislots * share)
        minislot[share == 1.0] = self._num_minislots - 1.0
        return Contention(minislot, self._busy_dbm + shift_db)

    def _follow_packets(self, views: LocalViews, recipient: np.ndarray) -> None:
        """Work out T in the packets of the last slot: each robot's own, and what it decoded.

        A packet holds T as it was before the slot, and the slot's end as its sender's own.
        """
        self._packet, self._earlier = self._earlier, self._packet
        own = np.arange(views.num_robots)
        self._before[:, own, own] = views.now[:, None]
        if self._last_sent is None:
            self._packet[...] = self._before
        else:
            self._packet[...] = choose_entries(
                self._before, recipient, self._num_entries, self._last_sent
            )
        self._before[...] = views.buffers.timestamp
