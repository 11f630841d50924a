"""Carrier sensing: robots that listen before they transmit (CSMA).

Kleinrock and Tobagi, Packet switching in radio channels, part I, IEEE Transactions on
Communications 23(12), 1975. Every robot always has a packet to send, and the time that sensing
takes is neglected.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission import Mission
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.policy import BroadcastPolicy, CentralisedPolicy
from swarm_mj.policies.random_access import RandomTransmission
from swarm_mj.protocol.buffers import BROADCAST
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.mission_radio import TrueLinks
from swarm_mj.system.compiled import compiled
from swarm_mj.system.decibels import from_db

SENSED_BELOW_DB = 8.0  # what just decodes: two and a half times the range, in free space


def sensed_dbm(mission: Mission) -> float:
    """Return the power from which a robot's channel is busy, the mission's own or the usual."""
    if mission.sensing_dbm is not None:
        return mission.sensing_dbm
    return mission.noise_dbm + mission.sinr_threshold_db - SENSED_BELOW_DB


class CarrierSense(RandomTransmission, CentralisedPolicy):
    """Robots broadcast unless they sense another's packet.

    Nobody answers. p-persistent CSMA, with which IEEE 802.11 agrees on average (Cali, Conti and
    Gregori 2000): a slot begins with minislots, and in each of them a robot whose channel is idle
    begins with probability p. So a robot senses those in earlier minislots, but collides with those
    in its own, and with those too far away to be sensed (hidden terminals).
    """

    is_centralised = False
    uses = "the power that it senses in the channel before it transmits"
    window = BroadcastPolicy.window

    def __init__(self, probability: float, sensing_dbm: float) -> None:
        """Take the probability in each minislot, and the power from which a channel is busy."""
        super().__init__(probability)
        self._sensed_mw = from_db(sensing_dbm)

    def inform(self, truth: TrueLinks) -> None:
        """Take the true channel, whose mean powers robots sense."""
        self._truth = truth

    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """Return `BROADCAST` for each robot that finds its channel idle."""
        # A geometric number; p = 0 waits forever, and p = 1 not at all.
        with np.errstate(divide="ignore"):
            minislot = np.floor(np.log1p(-self._stream.next()) / np.log1p(-self._probability))
        everyone = np.ones(minislot.shape, dtype=np.bool_)
        is_active = everyone if states.is_active is None else states.is_active
        recipient = views.silence.copy()
        for b, position_m in enumerate(states.position_m):
            power_mw = self._truth.links(position_m, b).interference_mw
            begins = beginners(minislot[b], is_active[b], power_mw, self._sensed_mw)
            recipient[b, begins] = BROADCAST
        return recipient


@compiled()
def beginners(
    minislot: Float[np.ndarray, "N"],
    is_active: Bool[np.ndarray, "N"],
    power_mw: Float[np.ndarray, "N N"],
    sensed_mw: float,
) -> Bool[np.ndarray, "N"]:
    """Return who transmits, if i adds this power at j once it has begun."""
    num_robots = len(minislot)
    begins, waits = np.zeros(num_robots, dtype=np.bool_), is_active & np.isfinite(minislot)
    air_mw = np.zeros(num_robots)
    while np.any(waits):
        now = np.inf
        for i in range(num_robots):
            if waits[i]:
                now = min(now, minislot[i])
        heard_mw = air_mw.copy()
        for i in range(num_robots):
            if waits[i] and heard_mw[i] >= sensed_mw:
                waits[i] = False
            elif waits[i] and minislot[i] == now:
                waits[i], begins[i] = False, True
                air_mw += power_mw[i]
    return begins
