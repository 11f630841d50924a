"""Carrier sensing: robots that listen before they transmit (CSMA).

Kleinrock and Tobagi, Packet switching in radio channels, part I, IEEE Transactions on
Communications 23(12), 1975. Every robot always has a packet to send, and the time that sensing
takes is neglected.
"""

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.about import Information, Leading, Listed, Look, PairMemory, Textbook
from swarm_mj.policies.policy import BroadcastPolicy, CentralisedPolicy
from swarm_mj.policies.random_access import RandomTransmission
from swarm_mj.policies.tdma import slot_of
from swarm_mj.protocol.buffers import BROADCAST
from swarm_mj.protocol.window import LocalViews
from swarm_mj.system.compiled import compiled
from swarm_mj.system.decibels import from_db

SENSED_BELOW_DB = 8.0  # what just decodes: two and a half times the range, in free space
# What robots that contend by age gain sense beside that in turn: from 2 to 4 times the range.
SHIFTS_DB = (2.0, 0.0, -2.0, -4.0)
MINISLOTS = 50.0  # by which twice the gain is earlier
DRAWN_MINISLOTS = 10.0  # at most, that a draw adds: robots that begin in one minislot collide
SENSING_MEMORY = PairMemory(bytes_per_pair=25.0)  # the power of each robot at each other


def sensed_dbm(mission: Mission) -> float:
    """Return the power from which a robot's channel is busy, the mission's own or usual [dBm]."""
    if mission.sensing_dbm is not None:
        return mission.sensing_dbm
    return mission.noise_dbm + mission.sinr_threshold_db - SENSED_BELOW_DB


class SensingPolicy(CentralisedPolicy):
    """The common base of policies whose robots broadcast unless they sense another's packet.

    Nobody answers. A slot begins with minislots. A robot begins in the one that it has chosen if
    its channel is idle. So it senses those in earlier minislots, but collides with those in its
    own, and with those too far away to be sensed (hidden terminals).

    A subclass chooses the minislots. What robots sense follows from the truth, which is why this
    is a `CentralisedPolicy`, although each robot decides by itself.
    """

    is_centralised = False
    window = BroadcastPolicy.window

    def __init__(self, *sensed_dbm: float) -> None:
        """Take the powers from which a channel is busy, of the slots in turn [dBm]."""
        self._sensed_mw = [from_db(each) for each in sensed_dbm]

    @abstractmethod
    def minislots(self, views: LocalViews) -> Float[np.ndarray, "B N"]:
        """Return each robot's minislot in the slot that begins.

        Args:
            views: What each robot knows, as in `DecentralisedPolicy.recipients`.

        Returns:
            A whole number at [b, i], counted from any origin; infinite if robot i does not want to
            transmit. It may depend on view [b, i] only.
        """

    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """Return `BROADCAST` for robots that find their channel idle, by the true mean powers."""
        minislot = self.minislots(views)
        slot = int(slot_of(views.now)[0])  # the clocks of all missions are alike
        sensed_mw = self._sensed_mw[slot % len(self._sensed_mw)]
        # Robots that are off neither transmit nor keep others from it.
        is_active = states.is_active
        if is_active is None:
            is_active = np.ones(minislot.shape, dtype=np.bool_)
        recipient = views.silence.copy()
        for b, position_m in enumerate(states.position_m):
            power_mw = self._truth.links(position_m, b).interference_mw
            begins = beginners(minislot[b], is_active[b], power_mw, sensed_mw)
            recipient[b, begins] = BROADCAST
        return recipient


class CarrierSense(RandomTransmission, SensingPolicy):
    """Robots broadcast unless they sense another's packet.

    p-persistent CSMA, with which IEEE 802.11 agrees on average (Cali, Conti and Gregori 2000): in
    each minislot a robot whose channel is idle begins with probability p.
    """

    about = Listed(
        name="csma",
        origin=Textbook(source="Kleinrock and Tobagi 1975; Cali, Conti and Gregori 2000"),
        rank=50,
        uses="the power that it senses in the channel before it transmits",
        beyond=(Information.RADIO_CONSTANTS, Information.CARRIER_SENSING),
        payload=None,
        look=Look(label="CSMA", colour="#661100", marker=">"),
        memory=SENSING_MEMORY,
    )

    @classmethod
    def with_probability(cls, mission: Mission, probability: float) -> "CarrierSense":
        """Return the policy for a mission's radio."""
        return cls(probability, sensed_dbm(mission))

    def __init__(self, probability: float, sensing_dbm: float) -> None:
        """Take the probability in each minislot, and the power from which a channel is busy.

        Args:
            probability: From 0 to 1.
            sensing_dbm: In dBm.

        Raises:
            ValueError: If the probability is no number from 0 to 1.
        """
        RandomTransmission.__init__(self, probability)
        SensingPolicy.__init__(self, sensing_dbm)

    def minislots(self, views: LocalViews) -> Float[np.ndarray, "B N"]:  # noqa: ARG002
        """Draw a geometric number for each robot; p = 0 waits forever, and p = 1 not at all."""
        # Robots begin before minislot m with the probability 1 - (1 - p)^m, which is inverted here.
        draw = self._stream.next()
        with np.errstate(divide="ignore"):
            return np.floor(np.log1p(-draw) / np.log1p(-self._probability))


class AgeGainCsma(SensingPolicy):
    """CSMA in which robots with more news transmit first.

    News is the age gain (Chen, Gatsis, Hassani and Shirani Bidokhti, Age of information in random
    access channels, 2022): by how much a packet lowers the ages at those who decode it. A robot
    estimates it as the rise of its mean T since its last packet. In a slot in which it decodes one,
    the rise counts less, by the share of its range that the sender covers: neighbours there have
    learned the same. The power that counts as busy changes from slot to slot: where it is low,
    fewer robots transmit, so that packets get through weaker links.
    """

    about = Listed(
        name="age-gain-csma",
        origin=Leading(over=("csma",)),  # which senses, too
        rank=60,
        uses=(
            "the power that it senses before it transmits, T, the clock, the size of the team, and "
            "how far away the senders that it decodes are by its buffer, in ranges"
        ),
        beyond=(
            Information.CLOCK,
            Information.TEAM_SIZE,
            Information.OBSERVED_POSITIONS,
            Information.RADIO_CONSTANTS,
            Information.CARRIER_SENSING,
            Information.DECODED_PACKETS,
        ),
        payload=None,
        look=Look(label="age-gain CSMA", colour="#2244ee", marker="8"),
        memory=SENSING_MEMORY,
    )

    @classmethod
    def for_mission(cls, mission: Mission) -> "AgeGainCsma":
        """Return the policy for a mission's radio."""
        return cls(mission)

    def __init__(self, mission: Mission) -> None:
        """Prepare the policy for the mission's radio."""
        super().__init__(*(sensed_dbm(mission) + shift_db for shift_db in SHIFTS_DB))
        self._range_m = mission.range_m

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Give every robot its own numbers, and no news; arguments as in `Policy.start`."""
        self._stream = Stream(rngs, uniform, (num_robots,))
        self._news = np.zeros((len(rngs), num_robots))  # since a robot's last packet [windows]
        self._known = np.zeros_like(self._news)  # mean T when it was last asked [windows]

    def minislots(self, views: LocalViews) -> Float[np.ndarray, "B N"]:
        """Return an earlier minislot the more news a robot has; without any it waits forever."""
        known = np.mean(views.buffers.timestamp, axis=2)
        is_new_to = 1.0 - covered_share(views, self._range_m)
        self._news += (known - self._known) * is_new_to
        self._known = known
        # News is at most about t, however long ago the last packet was, so minislots begin near 0.
        most = views.now[:, np.newaxis] + 1.0
        with np.errstate(divide="ignore"):
            octaves = np.log2(most / self._news)
        return np.floor(MINISLOTS * octaves + DRAWN_MINISLOTS * self._stream.next())

    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """Return `BROADCAST` for robots that find their channel idle; they have no more news."""
        recipient = super().recipients(views, states)
        self._news[recipient == BROADCAST] = 0.0
        return recipient


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


@compiled()
def beginners(
    minislot: Float[np.ndarray, "N"],
    is_active: Bool[np.ndarray, "N"],
    power_mw: Float[np.ndarray, "N N"],
    sensed_mw: float,
) -> Bool[np.ndarray, "N"]:
    """Return who transmits in a slot of one mission.

    Args:
        minislot: In which each robot begins if its channel is idle then; infinite: never.
        is_active: Whether each takes part at all.
        power_mw: [i, j]: what i adds to the air at j once it has begun [mW].
        sensed_mw: The power from which a channel is busy [mW].

    Returns:
        True for robots that transmit. One that finds its channel busy is silent for the slot.
    """
    num_robots = len(minislot)
    begins = np.zeros(num_robots, dtype=np.bool_)
    waits = is_active & np.isfinite(minislot)
    air_mw = np.zeros(num_robots)
    while np.any(waits):
        now = np.inf  # the next minislot in which anyone begins
        for i in range(num_robots):
            if waits[i]:
                now = min(now, minislot[i])
        # As it was before this minislot: those who begin in the same do not sense each other.
        heard_mw = air_mw.copy()
        for i in range(num_robots):
            if waits[i] and heard_mw[i] >= sensed_mw:
                waits[i] = False
            elif waits[i] and minislot[i] == now:
                waits[i] = False
                begins[i] = True
                air_mw += power_mw[i]
    return begins
