"""Self-organised TDMA: frames in which every robot owns a slot that it chose itself.

The idea is that of SOTDMA, the access scheme of ships' transponders (ITU-R M.1371): stations
announce the slots that they reserve, and choose slots that are free where they are. Here nobody
needs to announce anything, for T says when a teammate last transmitted, and so which slot is its
own. So robots agree on who transmits when, however wrong they are about positions.

The mission begins with spatial TDMA. After some rounds everyone works out first slots for all, from
positions that hardly differ by then. From then on one robot after the other chooses anew: it
simulates the whole frame, as it believes it to be, with itself in each slot, and takes the one that
keeps the team's information freshest. A slot in which neighbours miss its packets too often for
chance counts as one that they cannot hear it in. Some slots are left to robots that have lost a
neighbour.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.policies.about import Information, Listed, Look, PairMemory, Textbook
from swarm_mj.policies.policy import BroadcastPolicy, TeamView, team_views
from swarm_mj.policies.sotdma import slot_table
from swarm_mj.policies.sotdma.choices import choices_before, chosen
from swarm_mj.policies.sotdma.first_slots import FirstSlots, believed_powers
from swarm_mj.policies.sotdma.frame import Rule, frame_slots
from swarm_mj.policies.sotdma.slot_table import LONG_AGO, NO_PLACE, SlotTable, place_of
from swarm_mj.policies.tdma import SpatialTdma, draw_order
from swarm_mj.protocol.packets import fits, packet_of
from swarm_mj.protocol.timestamps import slot_at, slot_of
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.mission_radio import Belief, radio_of
from swarm_mj.radio.power_law import PowerLaw, write_powers
from swarm_mj.system.compiled import compiled

MAX_ROBOTS = 250  # with more, the first slots take minutes, and frames begin late in a mission


class SelfOrganisedTdma(BroadcastPolicy):
    """TDMA in which robots choose their slots themselves.

    Of what the mission grants of the channel it uses the mean powers.
    """

    about = Listed(
        name="sotdma",
        origin=Textbook(source="ITU-R M.1371, of 1998"),
        rank=100,
        uses=(
            "as spatial-tdma at first; then its buffer, T and P in the packets that it decodes, a "
            "common random order, the clock, the size of the team and its prior knowledge of the "
            "radio: robots own slots, announced implicitly by transmitting, and choose the slot "
            "that keeps the information freshest"
        ),
        # It begins as spatial-tdma, of which it has common random numbers and the area.
        beyond=(
            Information.COMMON_ORDER,
            Information.CLOCK,
            Information.TEAM_SIZE,
            Information.OBSERVED_POSITIONS,
            Information.RADIO_CONSTANTS,
            Information.COMMON_RANDOM_NUMBERS,
            Information.ACKNOWLEDGEMENTS,
            Information.DECODED_PACKETS,
            Information.AREA,
            Information.PRIOR_KNOWLEDGE,
        ),
        payload=None,
        look=Look(label="sotdma", colour="#666666", marker="d"),
        memory=PairMemory(bytes_per_pair=230.0, from_round=1.5),  # tables of slots, once it has any
    )

    @classmethod
    def for_mission(cls, mission: Mission) -> "SelfOrganisedTdma":
        """Return the policy for a mission's radio."""
        return cls(mission)

    def __init__(self, mission: Mission) -> None:
        """Prepare the policy for the mission's radio, in free space unless informed otherwise.

        Raises ValueError for a team that is too large to work out its first slots.
        """
        if mission.num_robots > MAX_ROBOTS:
            raise ValueError(
                f"sotdma flies teams of up to {MAX_ROBOTS} robots, not of {mission.num_robots:,}: "
                "each robot works out slots for all; choose fewer robots, or spatial-tdma"
            )
        self._turns = SpatialTdma(mission)
        self._belief = Belief(radio=radio_of(mission))
        # Packets say whom their senders heard only if they hold all of T and P as before the slot.
        # By the authors' rule a robot may decode while it transmits, which changes its T in it.
        is_whole = fits(packet_of(mission), mission)
        self._reads_packets = is_whole and not mission.recipient_hears_while_sending

    def inform(self, belief: Belief) -> None:
        """Take the powers that robots believe in."""
        super().inform(belief)
        self._turns.inform(belief)

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draw every mission's order; arguments as in `Policy.start`."""
        self._turns.start(num_robots, rngs)
        orders = draw_order(num_robots, rngs)
        self._teams = [
            SotdmaTeam(order, self._belief, reads_packets=self._reads_packets) for order in orders
        ]
        self._uniform = Stream(rngs, uniform, (num_robots,))

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return who owns the slot, or is in need where nobody does; at first, whose turn it is."""
        transmits = np.zeros(views.silence.shape, dtype=bool)
        if any(team.table is None for team in self._teams):
            transmits = self._turns.transmits(views)
        draw = self._uniform.next()
        for b, (team, view) in enumerate(zip(self._teams, team_views(views), strict=True)):
            transmits[b] = team.transmits(view, transmits[b], draw[b])
        return transmits


class SotdmaTeam:
    """Robots that choose their slots, each by its own beliefs."""

    def __init__(
        self, order: Int[np.ndarray, "N"], belief: Belief, *, reads_packets: bool = True
    ) -> None:
        """Prepare the team, whose robots choose in this order."""
        self._order = order
        self._reads_packets = reads_packets
        self._law = belief.law_over_noise(len(order))
        self._rule = Rule(belief.radio.threshold, frame_slots(len(order)))
        # The slot in which the first frame begins, known from the first decision on.
        self._frames_begin: int | None = None
        self.table: SlotTable | None = None  # there is none before the first frame
        self._first_slots: FirstSlots  # made with the table

    def transmits(
        self, view: TeamView, in_turn: Bool[np.ndarray, "N"], draw: Float[np.ndarray, "N"]
    ) -> Bool[np.ndarray, "N"]:
        """Return who transmits in the slot that begins; ask slot by slot.

        Before the first frame these are the robots in turn; `draw` is on [0, 1), for contention.
        """
        slot = self._frame_slot(view.now)
        if slot < 0:
            return in_turn
        is_known = view.is_known | np.eye(len(self._order), dtype=bool)
        if self.table is None:
            self._first_slots = FirstSlots(
                order=self._order,
                position_m=view.position_m,
                is_known=is_known,
                law=self._law,
                rule=self._rule,
            )
            self.table = slot_table.empty_table(self._first_slots.own(), self._rule.num_slots)
        known = self._last_transmissions(view)
        self._read(self.table, view, known, slot)
        self._choose(self.table, view, is_known, slot)
        place = place_of(slot, self._rule)
        if place == NO_PLACE:
            needs = self._are_in_need(self.table, view, is_known, known, slot)
            transmits = needs & (draw < self._rule.contention_probability)
        else:
            # [i, i] is robot i's own slot.
            transmits = np.diagonal(self.table.slots) == place
        self.table.sent[transmits] = slot
        return transmits

    def _frame_slot(self, now: float) -> int:
        """Return the slot that begins now, counted from the first frame; before it, below 0."""
        slot = slot_at(now)
        if self._frames_begin is None:
            self._frames_begin = slot + self._rule.first_rounds * len(self._order)
        return slot - self._frames_begin

    def _last_transmissions(self, view: TeamView) -> Int[np.ndarray, "N N"]:
        """Return in which slot each robot last transmitted, as each knows; [i, k] is of k."""
        # A robot observes itself as it transmits, so T is the end of that slot.
        return slot_of(view.timestamp) - 1 - (self._frames_begin or 0)

    def _read(
        self, table: SlotTable, view: TeamView, known: Int[np.ndarray, "N N"], slot: int
    ) -> None:
        """Note what the slot before this one taught everyone."""
        if self._reads_packets:
            slot_table.read_packets(table, view.heard, known, view.parent, slot - 1, self._rule)
        slot_table.read_slots(table, known, self._rule)

    def _choose(
        self, table: SlotTable, view: TeamView, is_known: Bool[np.ndarray, "N N"], slot: int
    ) -> None:
        """Let robots choose anew whose turns to choose come in this slot: mostly one, or none."""
        order = self._order
        first = choices_before(slot, len(order), self._rule)
        after = choices_before(slot + 1, len(order), self._rule)
        for turn in range(first, after):
            i = int(order[turn % len(order)])
            self._complete(table, i, is_known[i])
            table.slots[i, i] = chosen(
                i=i,
                slots=table.slots[i],
                announced=table.announced[i],
                is_known=is_known[i],
                is_marked=slot_table.marks(table, i, slot, self._rule),
                order=order,
                slot=slot,
                power=believed_powers(view.position_m[i], is_known[i], self._law),
                rule=self._rule,
            )

    def _complete(self, table: SlotTable, i: int, is_known: Bool[np.ndarray, "N"]) -> None:
        """Let robot i work out the first slots of those it knows that never announced another."""
        silent = is_known & (table.announced[i] == LONG_AGO)
        silent[i] = False  # it has its own
        table.slots[i, silent] = self._first_slots.of(i, silent)[silent]

    def _are_in_need(
        self,
        table: SlotTable,
        view: TeamView,
        is_known: Bool[np.ndarray, "N N"],
        known: Int[np.ndarray, "N N"],
        slot: int,
    ) -> Bool[np.ndarray, "N"]:
        """Return who lost a neighbour, or was lost by one, as far as it knows."""
        is_near = is_known & _is_in_range(view.position_m, self._law, self._rule.threshold)
        return slot_table.are_in_need(table, known, is_near, slot, self._rule)


@compiled()
def _is_in_range(
    position_m: Float[np.ndarray, "N N D"], law: PowerLaw, threshold: float
) -> Bool[np.ndarray, "N N"]:
    """Return who decodes each robot's lone packets, as it believes; powers are over the noise."""
    power = np.empty((position_m.shape[0], position_m.shape[0]))
    for i in range(power.shape[0]):
        write_powers(i, position_m[i], law, power[i])
    return power >= threshold
