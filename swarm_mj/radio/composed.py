"""A channel composed of named parts: path loss, obstruction, shadowing, fading, losses.

The SINR rule on top stays the paper's (Eqs. 3-4). What varies with time is a function of the
mission's key and of the slot, so a slot that is played again is the same slot.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, UInt64

from swarm_mj.radio.counters import keyed_uniform, link_key, mixed
from swarm_mj.radio.fading import NO_BURSTS, NO_FADING, Bursts, fade, is_in_burst
from swarm_mj.radio.link_gains import LinkGains
from swarm_mj.radio.reception import Air, decoded, incoming_at, silent_air, transmit
from swarm_mj.system.compiled import compiled

_FADES, _ERASURES, _BURSTS = np.uint64(1), np.uint64(2), np.uint64(3)  # what a key is used for


@dataclass(frozen=True, kw_only=True)
class Reception:
    """What decides whether a packet of a given mean power decodes."""

    noise_mw: float  # sigma [mW]
    threshold: float  # least SINR that decodes, linear [1]
    rician_k: float = NO_FADING  # 0 is Rayleigh; linear [1]
    erasure: float = 0.0  # probability that a packet is lost on a link, whatever its power [1]
    bursts: Bursts = NO_BURSTS
    recipient_hears_while_sending: bool = False  # as `FreeSpaceRadio`'s


class _Rule(NamedTuple):
    """`Reception`, as compiled loops take it."""

    noise_mw: float
    threshold: float
    rician_k: float
    erasure: float
    begin: float
    end: float
    hears_while_sending: bool


class ComposedChannel:
    """The channel of B missions; `at` gives that of one slot."""

    def __init__(self, gains: LinkGains, reception: Reception) -> None:
        self.gains = gains
        self.reception = reception

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:  # noqa: ARG002 - as a policy's
        """Start new missions; one generator each."""
        self._key = np.array([rng.integers(2**64, dtype=np.uint64) for rng in rngs])
        self.gains.start(rngs)

    def at(self, slot: Int[np.ndarray, "W"], mission: Int[np.ndarray, "W"]) -> "SlotChannel":
        """Who decodes whom in one slot.

        Args:
            slot: Of each row, counted from 0.
            mission: Of each row.

        Returns:
            A channel of W rows.
        """
        return SlotChannel(self, slot, mission)

    def largest_part(
        self, position_m: Float[np.ndarray, "N 2"], mission: int
    ) -> Bool[np.ndarray, "N"]:
        """Return the largest group in which everyone reaches everyone.

        Links are those whose packets decode in silence and without fades.

        Args:
            position_m: Where the robots of one mission are [m].
            mission: Which one; its shadowing is its own.

        Returns:
            Who belongs to it; of groups that are equally large, the one with the first robot.
        """
        rule = self.reception
        is_linked = self.mean_powers_mw(position_m, mission) >= rule.noise_mw * rule.threshold
        return _largest_part(is_linked)

    def mean_powers_mw(
        self, position_m: Float[np.ndarray, "N 2"], mission: int
    ) -> Float[np.ndarray, "N N"]:
        """Return the power of each robot at each other before fades; arguments as above [mW]."""
        everyone = np.ones((1, len(position_m)), dtype=np.bool_)
        row = np.array([mission])
        return self.gains.received_mw(position_m[None], row, everyone)[mission].copy()

    def decode(
        self,
        position_m: Float[np.ndarray, "W N 2"],
        recipient: Int[np.ndarray, "W N"],
        slot: Int[np.ndarray, "W"],
        mission: Int[np.ndarray, "W"],
    ) -> Int[np.ndarray, "W N"]:
        """Return the sender that each robot decodes; itself is nobody."""
        is_sender = recipient != np.arange(recipient.shape[1])
        received_mw = self.gains.received_mw(position_m, mission, is_sender)
        heard = np.empty_like(recipient)
        rule = self.reception
        _decode(
            received_mw,
            recipient,
            slot,
            mission,
            self._key,
            _Rule(
                rule.noise_mw,
                rule.threshold,
                rule.rician_k,
                rule.erasure,
                rule.bursts.begin,
                rule.bursts.end,
                rule.recipient_hears_while_sending,
            ),
            heard,
        )
        return heard


@dataclass(frozen=True)
class SlotChannel:
    """A `Channel` of one slot."""

    channel: ComposedChannel
    slot: Int[np.ndarray, "W"]
    mission: Int[np.ndarray, "W"]

    def __call__(
        self, position_m: Float[np.ndarray, "W N 2"], recipient: Int[np.ndarray, "W N"]
    ) -> Int[np.ndarray, "W N"]:
        """Whose packet each robot decodes; arguments as in `Channel`."""
        return self.channel.decode(position_m, recipient, self.slot, self.mission)


@compiled()
def _decode(
    received_mw: Float[np.ndarray, "B N N"],
    recipient: Int[np.ndarray, "W N"],
    slot: Int[np.ndarray, "W"],
    mission: Int[np.ndarray, "W"],
    mission_key: UInt64[np.ndarray, "B"],
    rule: _Rule,
    heard: Int[np.ndarray, "W N"],
) -> None:
    """Fill `heard`: the strongest packet at each receiver, if it clears the threshold."""
    num_rows, num_robots = recipient.shape
    for w in range(num_rows):
        key = np.uint64(mission_key[mission[w]])
        air = _air(received_mw[mission[w]], recipient[w], key, slot[w], rule)
        for j in range(num_robots):
            i = decoded(incoming_at(air, j), j, rule.noise_mw, rule.threshold)
            heard[w, j] = j if i == j or _is_lost(i, j, key, slot[w], rule) else i


@compiled()
def _air(
    received_mw: Float[np.ndarray, "N N"],
    recipient: Int[np.ndarray, "N"],
    key: np.uint64,
    slot: int,
    rule: _Rule,
) -> Air:
    """Return all packets of a slot, faded."""
    fades = mixed(mixed(key, _FADES), np.uint64(slot))
    air = silent_air(recipient.shape[0])
    for i in range(recipient.shape[0]):  # by sender: the powers of one stand side by side
        if recipient[i] == i:
            continue
        for j in range(recipient.shape[0]):
            if j != i:
                power_mw = received_mw[i, j]
                if rule.rician_k != NO_FADING:
                    power_mw *= fade(link_key(fades, i, j), rule.rician_k)
                may_hear = recipient[j] == j or (rule.hears_while_sending and recipient[i] == j)
                transmit(air, i, j, power_mw if may_hear else 0.0, power_mw)
    return air


@compiled()
def _is_lost(i: int, j: int, key: np.uint64, slot: int, rule: _Rule) -> bool:
    """Whether j loses i's packet although it is strong enough."""
    if rule.erasure > 0.0:
        erasures = mixed(mixed(key, _ERASURES), np.uint64(slot))
        if keyed_uniform(mixed(mixed(erasures, np.uint64(i)), np.uint64(j))) < rule.erasure:
            return True
    bursts = mixed(mixed(key, _BURSTS), np.uint64(j))
    return rule.begin > 0.0 and is_in_burst(bursts, slot, rule.begin, rule.end)


@compiled()
def _largest_part(is_linked: Bool[np.ndarray, "N N"]) -> Bool[np.ndarray, "N"]:
    """Return the largest group in which everyone reaches everyone over links from row to column."""
    num_robots = is_linked.shape[0]
    largest = np.zeros(num_robots, dtype=np.bool_)
    is_placed = np.zeros(num_robots, dtype=np.bool_)
    is_heard = np.ascontiguousarray(is_linked.T)
    for first in range(num_robots):
        if not is_placed[first]:
            part = reached_from(is_linked, first) & reached_from(is_heard, first)
            is_placed |= part
            if np.sum(part) > np.sum(largest):
                largest = part
    return largest


@compiled()
def reached_from(is_linked: Bool[np.ndarray, "N N"], start: int) -> Bool[np.ndarray, "N"]:
    """Whom a robot reaches over links from row to column; itself in any case."""
    num_robots = is_linked.shape[0]
    is_met, members = np.zeros(num_robots, dtype=np.bool_), np.empty(num_robots, dtype=np.int64)
    members[0], is_met[start] = start, True
    num_members, num_spread = 1, 0
    while num_spread < num_members:
        i = members[num_spread]
        num_spread += 1
        for j in range(num_robots):
            if is_linked[i, j] and not is_met[j]:
                is_met[j] = True
                members[num_members] = j
                num_members += 1
    return is_met
