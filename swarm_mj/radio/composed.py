"""A channel composed of named parts: path loss, obstruction, shadowing, fading, losses.

The SINR rule on top stays the paper's (Eqs. 3-4). What varies with time is a function of the
mission's key and of the slot, so a slot that is played again is the same slot.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int, UInt64

from swarm_mj.mission.geometry import PLANE
from swarm_mj.radio.fading import (
    NO_FADING,
    Waves,
    draw_waves,
    fade,
    is_in_burst,
    keyed_uniform,
    link_key,
    mixed,
)
from swarm_mj.radio.free_space import Channel
from swarm_mj.radio.power_law import MeanPowers, PowerLaw, compute_powers, no_powers, place_robots
from swarm_mj.radio.reception import (
    Air,
    Reception,
    add_to_air,
    decoded,
    incoming_at,
    may_decode,
    silent_air,
)
from swarm_mj.system.compiled import compiled

# What a mission's key is used for.
_FADES = np.uint64(1)
_ERASURES = np.uint64(2)
_BURSTS = np.uint64(3)


class ComposedChannel:
    """The channel of B missions; `at` gives that of one slot.

    Mean powers follow from the law (in mW), shadowing and positions. They are computed for those
    robots that transmit.
    """

    def __init__(
        self,
        law: PowerLaw,
        reception: Reception,
        *,
        shadowing_db: float = 0.0,
        shadowing_distance_m: float = 1.0,
        num_axes: int = PLANE,
    ) -> None:
        self.reception = reception
        self._law = law
        self._num_axes = num_axes  # of positions
        self._shadowing_db = shadowing_db
        self._shadowing_distance_m = shadowing_distance_m

    @property
    def at_1_m_mw(self) -> Float[np.ndarray, "N N"]:
        """The power of each robot's packets at each other after one metre of free space [mW]."""
        sent_mw = self._law.at_1_m[:, np.newaxis]
        antennas = self._law.antennas
        gain = np.ones(len(sent_mw)) if antennas is None else antennas.gain
        return sent_mw * gain

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Start new missions; one generator each, from which its own shadowing is drawn, too."""
        self.key = np.array([rng.integers(2**64, dtype=np.uint64) for rng in rngs])
        self._powers_mw = no_powers(self._law, len(rngs), self._num_axes)
        self._waves: Waves | None = None
        if self._shadowing_db > 0.0:
            self._waves = draw_waves(
                self._shadowing_db, self._shadowing_distance_m, num_robots, rngs
            )

    def at(self, slot: Int[np.ndarray, "W"], mission: Int[np.ndarray, "W"]) -> Channel:
        """Return the channel of W rows: of each its slot and its mission, counted from 0."""
        return lambda position_m, recipient: self._heard(position_m, recipient, slot, mission)

    def _heard(
        self,
        position_m: Float[np.ndarray, "W N D"],
        recipient: Int[np.ndarray, "W N"],
        slot: Int[np.ndarray, "W"],
        mission: Int[np.ndarray, "W"],
    ) -> Int[np.ndarray, "W N"]:
        is_sender = recipient != np.arange(recipient.shape[1])
        received_mw = self.received_mw(position_m, mission, is_sender)
        return _decode(received_mw, recipient, slot, mission, self.key, self.reception)

    def received_mw(
        self,
        position_m: Float[np.ndarray, "W N D"],
        mission: Int[np.ndarray, "W"],
        is_sender: Bool[np.ndarray, "W N"],
    ) -> Float[np.ndarray, "B N N"]:
        """Return the power of sender i at robot j before fades [mW]; of others, anything.

        Rows of one mission agree on positions. The next call overwrites the powers.
        """
        _update_powers(self._powers_mw, self._waves, position_m, mission, is_sender)
        return self._powers_mw.power

    def mean_powers_mw(
        self, position_m: Float[np.ndarray, "N D"], mission: int
    ) -> Float[np.ndarray, "N N"]:
        """Return the power of each robot of a mission at each other before fades [mW]."""
        everyone = np.ones((1, len(position_m)), dtype=np.bool_)
        return self.received_mw(position_m[None], np.array([mission]), everyone)[mission].copy()

    def largest_part(
        self, position_m: Float[np.ndarray, "N D"], mission: int
    ) -> Bool[np.ndarray, "N"]:
        """Return the largest group of a mission's robots in which everyone reaches everyone.

        Links are those that decode in silence, without fades; of equal groups it is the first.
        """
        rule = self.reception
        is_linked = self.mean_powers_mw(position_m, mission) >= rule.noise_mw * rule.threshold
        group = strong_groups(is_linked)
        return group == np.argmax(np.bincount(group))


def strong_groups(is_linked: Bool[np.ndarray, "N N"]) -> Int[np.ndarray, "N"]:
    """Return the first of each robot's strongly connected component; links go row to column."""
    from scipy.sparse.csgraph import connected_components  # slow to import

    _, label = connected_components(is_linked, connection="strong")
    _, first, group = np.unique(label, return_index=True, return_inverse=True)
    return first[group]


@compiled()
def _update_powers(
    powers_mw: MeanPowers,
    waves: Waves | None,
    position_m: Float[np.ndarray, "W N D"],
    mission: Int[np.ndarray, "W"],
    is_sender: Bool[np.ndarray, "W N"],
) -> None:
    """Compute the powers of senders that are new where the robots now are."""
    for w in range(mission.shape[0]):
        place_robots(powers_mw, mission[w], position_m[w], waves)
        for i in range(is_sender.shape[1]):
            if is_sender[w, i]:
                compute_powers(powers_mw, mission[w], i, waves)


@compiled()
def _decode(
    received_mw: Float[np.ndarray, "B N N"],
    recipient: Int[np.ndarray, "W N"],
    slot: Int[np.ndarray, "W"],
    mission: Int[np.ndarray, "W"],
    mission_key: UInt64[np.ndarray, "B"],
    rule: Reception,
) -> Int[np.ndarray, "W N"]:
    """Return the sender of the strongest packet at each receiver, if it clears the threshold."""
    num_rows, num_robots = recipient.shape
    heard = np.empty_like(recipient)
    for w in range(num_rows):
        key = np.uint64(mission_key[mission[w]])
        air = _faded_air(received_mw[mission[w]], recipient[w], key, slot[w], rule)
        for j in range(num_robots):
            i = decoded(incoming_at(air, j), j, rule.noise_mw, rule.threshold)
            if i != j and is_lost(i, j, key, slot[w], rule):
                i = j
            heard[w, j] = i
    return heard


@compiled()
def _faded_air(
    received_mw: Float[np.ndarray, "N N"],
    recipient: Int[np.ndarray, "N"],
    key: np.uint64,
    slot: int,
    rule: Reception,
) -> Air:
    """Return the packets of a slot at every receiver, after their fades."""
    fades = _key_in_slot(key, _FADES, slot)
    air = silent_air(recipient.shape[0])
    for i in range(recipient.shape[0]):  # by sender: the powers of one stand side by side
        if recipient[i] == i:
            continue
        for j in range(recipient.shape[0]):
            if j != i:
                power_mw = _faded(received_mw[i, j], fades, i, j, rule)
                is_silent = recipient[j] == j
                hears_while_sending = rule.recipient_hears_while_sending
                is_open = may_decode(is_silent, recipient[i], j, hears_while_sending)
                add_to_air(air, i, j, power_mw if is_open else 0.0, power_mw)
    return air


@compiled()
def faded_powers(
    received_mw: Float[np.ndarray, "B N N"],
    is_sender: Bool[np.ndarray, "B N"],
    slot: Int[np.ndarray, "B"],
    key: UInt64[np.ndarray, "B"],
    rule: Reception,
    power_mw: Float[np.ndarray, "B N N"],
) -> None:
    """Fill in the power of each packet at each other robot [mW]; 0 of a robot that is silent."""
    num_missions, num_robots = is_sender.shape
    for b in range(num_missions):
        fades = _key_in_slot(key[b], _FADES, slot[b])
        for i in range(num_robots):
            for j in range(num_robots):
                if is_sender[b, i] and i != j:
                    power_mw[b, i, j] = _faded(received_mw[b, i, j], fades, i, j, rule)
                else:
                    power_mw[b, i, j] = 0.0


@compiled()
def _key_in_slot(key: np.uint64, purpose: np.uint64, slot: int) -> np.uint64:
    """Return a mission's key for one purpose in one slot."""
    return mixed(mixed(key, purpose), np.uint64(slot))


@compiled()
def _faded(power_mw: float, fades: np.uint64, i: int, j: int, rule: Reception) -> float:
    if rule.rician_k == NO_FADING:
        return power_mw
    return power_mw * fade(link_key(fades, i, j), rule.rician_k)


@compiled()
def is_lost(i: int, j: int, key: np.uint64, slot: int, rule: Reception) -> bool:
    """Return whether j loses i's packet although it is strong enough."""
    if rule.erasure > 0.0:
        erasures = _key_in_slot(key, _ERASURES, slot)
        packet = mixed(mixed(erasures, np.uint64(i)), np.uint64(j))
        if keyed_uniform(packet) < rule.erasure:
            return True
    if rule.burst_begin == 0.0:
        return False
    bursts = mixed(mixed(key, _BURSTS), np.uint64(j))
    return is_in_burst(bursts, slot, rule.burst_begin, rule.burst_end)
