"""Carrier sensing: robots that listen before they transmit (CSMA).

Kleinrock and Tobagi, Packet switching in radio channels, part I, IEEE Transactions on
Communications 23(12), 1975. What robots sense is the radio's: see `radio.carrier_sensing`.
"""

import math
from abc import abstractmethod
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.policies.about import Information, Leading, Listed, Look, PairMemory, Textbook
from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.policies.random_access import RandomTransmission
from swarm_mj.protocol.packets import Packet, fitting, packet_of
from swarm_mj.protocol.timestamps import slot_at
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.carrier_sensing import Contention, Sensing, usual_busy_dbm

SENSING_MEMORY = PairMemory(bytes_per_pair=8.0)  # the power of each robot at each other

# How robots contend by age gain. Chosen by missions of the seeds from 920000 to 920039: at rest at
# range ratios of 0.2 to 1, walks of 10 to 200 robots, flocks, and blocks of 5 to 40.
TURN_EVERY = 5  # slots, of which the last is a turn; without turns, a quarter never hears everyone
NUM_TURNS = 40  # at most: robots that share one in larger teams are mostly far apart
LEAST_NEWS = 0.4  # with less a robot is silent [windows]; without it, blocks have twice the age
MOST_NEWS = 40.0  # at most N: what begins in the first minislot [windows]
DRAWN_SHARE = 1 / 16  # of the minislots, that a draw adds: robots that begin in one collide


class SensingPolicy(BroadcastPolicy):
    """A policy whose robots broadcast unless they sense another's packet; nobody answers.

    A subclass says in which minislot of the slot each robot listens, and from which power it holds
    back. The radio then says who transmits. Which robot decodes what is left to the window, as for
    all policies.

    Example:
        Robots with a number of their own go first, and others hold back from -55 dBm on:

        >>> class Ranked(SensingPolicy):
        ...     def contend(self, views):
        ...         minislot = views.silence.astype(float)
        ...         return Contention(minislot, np.full_like(minislot, -55.0))
    """

    def listen(self, sensing: Sensing) -> None:
        """Receive, before `start`, the radio that answers contentions.

        Args:
            sensing: Called once for each slot; it says who transmits, and nothing else.
        """
        self._sensing = sensing

    @abstractmethod
    def contend(self, views: LocalViews) -> Contention:
        """Return how each robot contends for the slot that begins.

        Args:
            views: What each robot knows, as in `DecentralisedPolicy.recipients`.

        Returns:
            A minislot and a power at [b, i], which may depend on view [b, i] only.
        """

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return the robots that contend and find their channel idle."""
        return self._sensing(self.contend(views))

    def packet(self, mission: Mission) -> Packet:
        """Return the packet of the policy, for which minislots leave the rest of a slot."""
        packet = packet_of(mission, self.payload_fields(mission))
        return fitting(packet, mission, type(self).__name__, taken_s=mission.contention_s)


class CarrierSense(RandomTransmission, SensingPolicy):
    """Robots broadcast unless they sense another's packet.

    p-persistent CSMA, with which IEEE 802.11 agrees on average (Cali, Conti and Gregori 2000): in
    each minislot a robot whose channel is idle begins with probability p. There is one difference:
    minislots end, and a robot that draws none of them is silent until the next slot.
    """

    about = Listed(
        name="csma",
        origin=Textbook(source="Kleinrock and Tobagi 1975; Cali, Conti and Gregori 2000"),
        rank=50,
        uses="the power that it senses in the channel before it transmits",
        beyond=(Information.RADIO_CONSTANTS, Information.CARRIER_SENSING),
        payload=None,
        look=Look(label="csma", colour="#661100", marker=">"),
        memory=SENSING_MEMORY,
    )

    @classmethod
    def with_probability(cls, mission: Mission, probability: float) -> "CarrierSense":
        """Return the policy for a mission's radio."""
        return cls(probability, usual_busy_dbm(mission))

    def __init__(self, probability: float, busy_dbm: float) -> None:
        """Take the probability in each minislot, and the power from which a channel is busy.

        Args:
            probability: From 0 to 1.
            busy_dbm: In dBm.

        Raises:
            ValueError: If the probability is no number from 0 to 1.
        """
        super().__init__(probability)
        self._busy_dbm = busy_dbm

    def contend(self, views: LocalViews) -> Contention:  # noqa: ARG002
        """Draw a geometric number for each robot; p = 0 waits forever, and p = 1 not at all."""
        # Robots begin before minislot m with the probability 1 - (1 - p)^m, which is inverted here.
        draw = self._stream.next()
        with np.errstate(divide="ignore"):
            minislot = np.floor(np.log1p(-draw) / np.log1p(-self._probability))
        return Contention(minislot, np.full_like(minislot, self._busy_dbm))


class AgeGainCsma(SensingPolicy):
    """CSMA in which robots with more news transmit first.

    News is the age gain (Chen, Gatsis, Hassani and Shirani Bidokhti, Age of information in random
    access channels, 2022): by how much a packet lowers the ages at those who decode it. A robot
    estimates it as the rise of its mean T since its last packet. In a slot in which it decodes one,
    the rise counts less, by the share of its range that the sender covers: neighbours there have
    learned the same. Robots with little news are silent. In some slots robots take turns, so that
    none is kept from transmitting for good.
    """

    about = Listed(
        name="age-gain-csma",
        origin=Leading(over=("csma",)),  # which senses, too
        rank=60,
        uses=(
            "the power that it senses before it transmits, T, the clock, its identity, the size of "
            "the team, and how far away the senders that it decodes are by its buffer, in ranges"
        ),
        beyond=(
            Information.COMMON_ORDER,
            Information.CLOCK,
            Information.TEAM_SIZE,
            Information.OBSERVED_POSITIONS,
            Information.RADIO_CONSTANTS,
            Information.CARRIER_SENSING,
            Information.DECODED_PACKETS,
        ),
        payload=None,
        look=Look(label="age-gain-csma", colour="#2244ee", marker="8"),
        memory=SENSING_MEMORY,
    )

    @classmethod
    def for_mission(cls, mission: Mission) -> "AgeGainCsma":
        """Return the policy for a mission's radio."""
        return cls(mission)

    def __init__(self, mission: Mission) -> None:
        """Prepare the policy for the mission's radio."""
        self._range_m = mission.range_m
        self._num_minislots = mission.minislots
        self._busy_dbm = usual_busy_dbm(mission)

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Give every robot its own numbers, and no news; arguments as in `Policy.start`."""
        self._stream = Stream(rngs, uniform, (num_robots,))
        self._news = np.zeros((len(rngs), num_robots))  # since a robot's last packet [windows]
        self._known = np.zeros_like(self._news)  # mean T when it was last asked [windows]

    def contend(self, views: LocalViews) -> Contention:
        """Return an earlier minislot the more news a robot has; in turns, that of the owner."""
        self._bring_news(views)
        turn = turn_at(slot_at(views.now[0]))  # the clocks of all missions are alike
        return self._by_news() if turn is None else in_turn(views, turn)

    def _by_news(self) -> Contention:
        """Return an earlier minislot the more news a robot has; with little it has none."""
        most = min(float(self._news.shape[1]), MOST_NEWS)
        news = np.clip(self._news, LEAST_NEWS, most)
        # Equal steps from the most news to the least are equal ratios.
        share = np.log(most / news) / math.log(most / LEAST_NEWS)
        share += DRAWN_SHARE * self._stream.next()
        minislot = np.minimum(np.floor(self._num_minislots * share), self._num_minislots - 1.0)
        minislot[self._news < LEAST_NEWS] = np.inf
        return Contention(minislot, np.full_like(minislot, self._busy_dbm))

    def _bring_news(self, views: LocalViews) -> None:
        """Count what robots have learned, and forget what they have sent."""
        if views.phases:
            self._news[views.phases[-1].recipient != views.silence] = 0.0
        known = np.mean(views.buffers.timestamp, axis=2)
        is_new_to = 1.0 - covered_share(views, self._range_m)
        self._news += (known - self._known) * is_new_to
        self._known = known


def turn_at(slot: int) -> int | None:
    """Return the number of the turn that a slot is, or None if it is for the robots with news."""
    turn, place = divmod(slot, TURN_EVERY)
    return turn if place == TURN_EVERY - 1 else None


def in_turn(views: LocalViews, turn: int) -> Contention:
    """Return the contention of a turn: its owners do not listen, and all others are silent.

    A robot owns a turn if its identity and the turn's number are equal modulo `NUM_TURNS`.
    """
    num_turns = min(views.num_robots, NUM_TURNS)
    is_owner = views.silence % num_turns == turn % num_turns
    minislot = np.where(is_owner, 0.0, np.inf)
    return Contention(minislot, np.full_like(minislot, np.inf))


def covered_share(views: LocalViews, range_m: float) -> Float[np.ndarray, "B N"]:
    """Return how much of each robot's range is also that of the sender decoded last, from 0 to 1.

    0 where it decoded nobody. Ranges are discs, and places what the robot believes.
    """
    if not views.phases:
        return np.zeros(views.silence.shape)
    heard = views.phases[-1].heard
    position_m = views.buffers.position_m
    mission, robot = np.ogrid[: heard.shape[0], : heard.shape[1]]
    apart_m = position_m[mission, robot, heard] - position_m[mission, robot, robot]
    # Two discs of one radius r, d apart, share a lens of 2 r² (arccos h - h sqrt(1 - h²)), where
    # h = d / (2 r).
    half = np.minimum(np.linalg.norm(apart_m, axis=-1) / (2.0 * range_m), 1.0)
    share = (np.arccos(half) - half * np.sqrt(1.0 - half**2)) * 2.0 / np.pi
    return np.where(heard == views.silence, 0.0, share)
