"""Carrier sensing: who finds the channel idle in the minislot that it chose, by the true powers.

A slot begins with minislots. In the one that a robot chose it listens, and transmits from then on
unless it senses a busy channel: then it is silent for the slot. So robots hold back for those who
began in earlier minislots, but collide with those of their own, and with those too far away to be
sensed (hidden terminals: Kleinrock and Tobagi 1975).

No receiver senses everything. A robot looks for a preamble that it knows, whose processing gain
lifts it out of the noise; what is weaker than `Mission.sensing_floor_dbm` leaves no trace.

Policies contend without any knowledge of the truth: they say in which minislot each robot listens
and from which power it holds back, and learn who may transmit. Index order: `i` sends, `j` senses.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.physics.state import RobotStates
from swarm_mj.radio.mission_radio import TrueLinks
from swarm_mj.system.compiled import compiled
from swarm_mj.system.decibels import from_db

SENSED_BELOW_DB = 8.0  # what just decodes: two and a half times the range, in free space


class Contention(NamedTuple):
    """How each robot contends for the slot that begins."""

    minislot: Float[np.ndarray, "B N"]  # in which it listens, a whole number from 0; inf: in none
    busy_dbm: Float[np.ndarray, "B N"]  # power from which it holds back; inf: it does not listen


# The radio's answer to a contention: True for robots that transmit. It is all that a policy learns.
Sensing = Callable[[Contention], Bool[np.ndarray, "B N"]]


def usual_busy_dbm(mission: Mission) -> float:
    """Return the power from which a robot's channel is busy, the mission's own or usual [dBm]."""
    if mission.sensing_dbm is not None:
        return mission.sensing_dbm
    usual_dbm = mission.noise_dbm + mission.sinr_threshold_db - SENSED_BELOW_DB
    return max(usual_dbm, mission.sensing_floor_dbm)


class CarrierSensing:
    """The sensing of the robots of B missions; `Swarm` asks it for each slot.

    Args:
        mission: Its floor, minislots, misses and false alarms.
        truth: The powers that robots sense: means, without fades.
    """

    def __init__(self, mission: Mission, truth: TrueLinks) -> None:
        self._floor_dbm = mission.sensing_floor_dbm
        self._num_minislots = mission.minislots
        self._errs = mission.sensing_miss > 0.0 or mission.sensing_false_alarm > 0.0
        self._miss = mission.sensing_miss
        self._false_alarm = mission.sensing_false_alarm
        self._truth = truth

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Start new missions, one generator each, from which its receivers' errors are drawn."""
        self._errors = Stream(rngs, uniform, (2, num_robots)) if self._errs else None

    def transmit(self, contention: Contention, states: RobotStates) -> Bool[np.ndarray, "B N"]:
        """Return who finds its channel idle and so transmits in the slot that begins.

        Args:
            contention: When each robot listens, and what holds it back. Powers below the floor
                count as the floor, and minislots that the slot does not have as none.
            states: Where the robots truly are. Those that are off neither transmit nor keep others
                from it.

        Returns:
            True for robots that transmit.

        Raises:
            ValueError: Unless there are a minislot and a power for each robot.
        """
        minislot = _checked("minislots", contention.minislot, states)
        busy_dbm = _checked("busy_dbm", contention.busy_dbm, states)
        listens = busy_dbm < np.inf
        busy_mw = from_db(np.maximum(busy_dbm, self._floor_dbm))
        minislot = np.floor(minislot)  # no receiver tells more moments apart than there are
        contends = (minislot >= 0.0) & (minislot < self._num_minislots)
        if states.is_active is not None:
            contends &= states.is_active
        if self._errors is not None:
            missing, alarming = self._errors.next().swapaxes(0, 1)  # of [B 2 N]
            busy_mw = np.where(missing < self._miss, np.inf, busy_mw)
            contends &= ~(listens & (alarming < self._false_alarm))
        begins = np.zeros(contends.shape, dtype=np.bool_)
        for b in np.flatnonzero(np.any(contends, axis=1)).tolist():
            power_mw = self._truth.mean_powers_mw(states.position_m[b], b)
            begins[b] = beginners(minislot[b], contends[b], power_mw, busy_mw[b])
        return begins


def _checked(what: str, value: np.ndarray, states: RobotStates) -> Float[np.ndarray, "B N"]:
    """Return what a policy says of each robot; ValueError unless it is a number for each."""
    number = np.asarray(value, dtype=np.float64)
    shape = states.position_m.shape[:2]
    if number.shape != shape or np.any(np.isnan(number)):
        raise ValueError(
            f"{what} of a contention must be one number for each robot, of shape {shape}, missions "
            f"by robots, not {np.array2string(number, threshold=8)}"
        )
    return number


@compiled()
def beginners(
    minislot: Float[np.ndarray, "N"],
    contends: Bool[np.ndarray, "N"],
    power_mw: Float[np.ndarray, "N N"],
    busy_mw: Float[np.ndarray, "N"],
) -> Bool[np.ndarray, "N"]:
    """Return who transmits in a slot of one mission.

    Args:
        minislot: In which each robot begins if its channel is idle then.
        contends: Whether each takes part at all.
        power_mw: [i, j]: what i adds to the air at j once it has begun [mW].
        busy_mw: The power from which each finds its channel busy [mW].

    Returns:
        True for robots that transmit. One that finds its channel busy is silent for the slot.
    """
    num_robots = len(minislot)
    begins = np.zeros(num_robots, dtype=np.bool_)
    waits = contends.copy()
    air_mw = np.zeros(num_robots)
    while np.any(waits):
        now = np.inf  # the next minislot in which anyone begins
        for i in range(num_robots):
            if waits[i]:
                now = min(now, minislot[i])
        # As it was before this minislot: those who begin in the same do not sense each other.
        sensed_mw = air_mw.copy()
        for i in range(num_robots):
            if waits[i] and sensed_mw[i] >= busy_mw[i]:
                waits[i] = False
            elif waits[i] and minislot[i] == now:
                waits[i] = False
                begins[i] = True
                air_mw += power_mw[i]
    return begins
