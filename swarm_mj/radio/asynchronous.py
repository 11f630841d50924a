"""Asynchronous clocks (VI): packets that robots send early or late, and that overlap in part.

All robots decide when a slot of the earliest clock begins; each transmits when its own begins. A
packet takes `AIRTIME` of a slot, and the rest is a guard interval. A packet that has not ended by
the next decision is late: it counts as decoded in the next slot. Another packet interferes with the
share of it that both overlap. Index order: `[p, b, i, j]` is robot `i`, which sends in slot `p`
(`BEFORE_LAST`, `LAST` or `NOW`), and `j`, which receives.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, UInt64

from swarm_mj.radio.composed import ComposedChannel, faded_powers, is_lost
from swarm_mj.radio.free_space import Channel
from swarm_mj.radio.reception import Reception, is_received, sinr
from swarm_mj.system.compiled import compiled

AIRTIME = 0.8  # of a slot; the bytes of a slot are those of all of it (`packets.slot_bytes`)
GUARD = 1.0 - AIRTIME
# Packets overlap those of the slots before and after their own, so three slots are kept.
BEFORE_LAST = 0
LAST = 1
NOW = 2
NUM_SLOTS = 3


class Arrivals(NamedTuple):
    """The packets that arrive in one slot, late ones and those that were sent in it."""

    late: Int[np.ndarray, "B N"]  # whom i addressed a slot ago, if that packet comes late
    heard_late: Int[np.ndarray, "B N"]  # whose late packet j decoded; itself: none
    punctual: Int[np.ndarray, "B N"]  # whom i addressed now, if that packet comes in time
    heard_now: Int[np.ndarray, "B N"]  # whose punctual packet j decoded; itself: none
    # Whose own packet of this slot had begun when what it decoded ended: what robots learn so is
    # not in that packet. Only by the authors' half-duplex rule does anyone decode so.
    learned_too_late: Bool[np.ndarray, "B N"]


class AsynchronousChannel:
    """A channel between robots whose clocks differ; slots must be played in order, and once."""

    def __init__(self, channel: ComposedChannel, offset: float, drift: float) -> None:
        """Take the greatest offset [slots] and drift [1]; robots' own are drawn uniformly."""
        self._channel = channel
        self._most_offset = offset
        self._most_drift = drift

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Start new missions; the clocks are drawn after all else."""
        self._channel.start(num_robots, rngs)
        shape = (len(rngs), num_robots)
        offset_share = np.empty(shape)
        drift_share = np.empty(shape)
        for b, rng in enumerate(rngs):
            offset_share[b] = rng.random(num_robots)
            drift_share[b] = rng.random(num_robots)
        self._offset = self._most_offset * offset_share
        self._drift = self._most_drift * (2.0 * drift_share - 1.0)
        self._silence = np.broadcast_to(np.arange(num_robots), self._offset.shape)
        self._lag = np.zeros((NUM_SLOTS, *self._offset.shape))
        self._recipient = np.stack([self._silence] * NUM_SLOTS)
        self._power_mw = np.zeros((*self._lag.shape, num_robots))

    def at(self, slot: Int[np.ndarray, "B"], mission: Int[np.ndarray, "B"]) -> Channel:
        """Return the channel of the next slot, in all missions in order."""
        return lambda position_m, recipient: self._heard(position_m, recipient, slot, mission)

    def lag(self, slot: Int[np.ndarray, "B"]) -> Float[np.ndarray, "B N"]:
        """Return how far each robot's slots are behind those of its team's earliest [slots].

        A robot that falls behind by a whole slot is as one that keeps up: numbers are common.
        """
        clock = self._offset + self._drift * slot[:, np.newaxis]
        return (clock - np.min(clock, axis=1, keepdims=True)) % 1.0

    def _heard(
        self,
        position_m: Float[np.ndarray, "B N D"],
        recipient: Int[np.ndarray, "B N"],
        slot: Int[np.ndarray, "B"],
        mission: Int[np.ndarray, "B"],
    ) -> Int[np.ndarray, "B N"]:
        for kept in (self._lag, self._recipient, self._power_mw):
            kept[BEFORE_LAST] = kept[LAST]
            kept[LAST] = kept[NOW]
        key = self._channel.key
        rule = self._channel.reception
        is_sender = recipient != self._silence
        mean_mw = self._channel.received_mw(position_m, mission, is_sender)
        faded_powers(mean_mw, is_sender, slot, key, rule, self._power_mw[NOW])
        self._lag[NOW] = self.lag(slot)
        self._recipient[NOW] = recipient
        return decode_overlapping(self._lag, self._recipient, self._power_mw, slot, key, rule)

    def split(self, heard: Int[np.ndarray, "B N"]) -> Arrivals:
        """Return which of the packets that were `heard` in this slot came late, and which not."""
        is_late = self._lag > GUARD
        silence = self._silence
        late = np.where(is_late[LAST], self._recipient[LAST], silence)
        punctual = np.where(is_late[NOW], silence, self._recipient[NOW])
        came_late = np.take_along_axis(late, heard, axis=1) != heard
        # Packets of one length that do not overlap come one after the other.
        begun_before = np.take_along_axis(self._lag[LAST], heard, axis=1) - 1.0
        begun_now = np.take_along_axis(self._lag[NOW], heard, axis=1)
        apart = np.abs(np.where(came_late, begun_before, begun_now) - self._lag[NOW])
        sends = self._recipient[NOW] != silence
        return Arrivals(
            late=late,
            heard_late=np.where(came_late, heard, silence),
            punctual=punctual,
            heard_now=np.where(came_late, silence, heard),
            learned_too_late=sends & (heard != silence) & (apart < AIRTIME),
        )


@compiled()
def decode_overlapping(
    lag: Float[np.ndarray, "3 B N"],
    recipient: Int[np.ndarray, "3 B N"],
    power_mw: Float[np.ndarray, "3 B N N"],
    slot: Int[np.ndarray, "B"],
    key: UInt64[np.ndarray, "B"],
    rule: Reception,
) -> Int[np.ndarray, "B N"]:
    """Return the sender of the strongest packet that ends now and decodes, at each receiver.

    Robots that are silent have no power. No `Air` as in `composed`: what interferes differs from
    packet to packet, as each overlaps others in part.
    """
    _, num_missions, num_robots = lag.shape
    heard = np.empty((num_missions, num_robots), dtype=np.int64)
    for b in range(num_missions):
        for j in range(num_robots):
            heard[b, j] = j
            strongest_mw = 0.0
            for p in (LAST, NOW):
                for i in range(num_robots):
                    is_late = lag[p, b, i] > GUARD
                    ends_later = is_late == (p == NOW)
                    signal_mw = power_mw[p, b, i, j]
                    if ends_later or signal_mw <= strongest_mw:
                        continue
                    # What noise alone drowns needs no sum over others, which costs most here.
                    over_noise = sinr(signal_mw, 0.0, rule.noise_mw)
                    if not is_received(over_noise, rule.threshold):
                        continue
                    jam_mw = _interference(
                        lag=lag[:, b],
                        recipient=recipient[:, b],
                        power_mw=power_mw[:, b],
                        p=p,
                        i=i,
                        j=j,
                        rule=rule,
                    )
                    ratio = sinr(signal_mw, jam_mw, rule.noise_mw)
                    is_clear = is_received(ratio, rule.threshold)
                    if is_clear and not is_lost(i, j, key[b], slot[b], rule):
                        heard[b, j] = i
                        strongest_mw = signal_mw
    return heard


@compiled()
def _interference(
    lag: Float[np.ndarray, "3 N"],
    recipient: Int[np.ndarray, "3 N"],
    power_mw: Float[np.ndarray, "3 N N"],
    p: int,
    i: int,
    j: int,
    rule: Reception,
) -> float:
    """Return the mean power of all others while i's packet of slot p is at j [mW].

    It is infinite if j transmits meanwhile, unless it hears all the same.
    """
    total_mw = 0.0
    # Half duplex as by `may_decode`, a call of which makes this loop a seventh slower.
    hears = rule.recipient_hears_while_sending and recipient[p, i] == j
    for q in range(NUM_SLOTS):
        for k in range(recipient.shape[1]):
            if recipient[q, k] == k or k == i:
                continue
            apart = abs(p - q + lag[p, i] - lag[q, k])  # between the packets' beginnings [slots]
            if apart < AIRTIME:
                share = 1.0 - apart / AIRTIME
                if k != j:
                    total_mw += share * power_mw[q, k, j]
                elif not hears:
                    return np.inf
    return total_mw
