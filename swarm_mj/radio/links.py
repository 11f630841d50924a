"""Links as a scheduler believes in them, and the receptions it predicts over them (Eqs. 3-4).

Index order: `i` sends, `j` receives.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.radio.decode_curves import KNOWN, Curves, probability_at, row_of
from swarm_mj.radio.free_space import DB_PER_NEPER, FreeSpaceRadio
from swarm_mj.radio.reception import (
    MIN_DISTANCE_M,
    NOBODY,
    Air,
    Incoming,
    add_packet,
    decode_probability,
    incoming_at,
    silent_air,
    sinr,
    transmit,
)
from swarm_mj.system.compiled import compiled


class Links(NamedTuple):
    """The radio between robots whose positions are true, or only believed."""

    received_mw: Float[np.ndarray, "N N"]  # power of i at j; 0 where none is counted on [mW]
    distance_over_std: Float[np.ndarray, "N N"]  # of the belief; inf if the positions are known [1]
    noise_mw: float
    threshold: float  # least SINR that decodes, linear [1]
    curves: Curves  # of `decode_curves`; `KNOWN`: nothing is doubtful but the positions
    row: Int[np.ndarray, "N N"]  # of these curves: how doubtful the power is
    interference_mw: Float[np.ndarray, "N N"]  # what i's packet adds to the air at j [mW]

    @property
    def is_doubtful(self) -> bool:
        """True if powers fade, or are known up to an error, even where positions are known."""
        return len(self.curves) > 0


def links_between(
    radio: FreeSpaceRadio,
    position_m: Float[np.ndarray, "N 2"],
    spread_m: Float[np.ndarray, "N"] | None = None,
    is_known: Bool[np.ndarray, "N"] | None = None,
) -> Links:
    """Return the links between robots at believed positions.

    Each belief has a standard deviation `spread_m`; None: the positions are true. Robots that are
    not known to be anywhere hear nothing and are not heard; None: everyone is known.
    """
    apart_m = position_m[:, None] - position_m[None, :]
    distance_m = np.maximum(np.sqrt(np.sum(apart_m**2, axis=2)), MIN_DISTANCE_M)
    received_mw = radio.received_at_1_m_mw / distance_m**2  # as `received_power`
    np.fill_diagonal(received_mw, 0.0)  # nobody receives itself
    if is_known is not None:
        received_mw *= is_known[:, None] & is_known[None, :]
    distance_over_std = np.full_like(distance_m, np.inf)
    if spread_m is not None:
        variance_m2 = spread_m[:, None] ** 2 + spread_m[None, :] ** 2
        np.divide(distance_m, np.sqrt(variance_m2), out=distance_over_std, where=variance_m2 > 0.0)
    nothing = np.zeros(distance_m.shape, dtype=np.int64)
    return Links(
        received_mw, distance_over_std, radio.noise_mw, radio.threshold, KNOWN, nothing, received_mw
    )


def doubtful(links: Links, curves: Curves, std_db: Float[np.ndarray, "N N"]) -> Links:
    """Return the same links over a channel that fades, or whose powers are known up to an error.

    That error's standard deviation is in dB, without what positions add to it.
    """
    return links._replace(
        curves=curves, row=row_of(np.hypot(std_db, 2.0 * DB_PER_NEPER / links.distance_over_std))
    )


@compiled()
def chance(links: Links, ratio: float, i: int, j: int) -> float:
    """Return the probability that j decodes i at this SINR, linear [1]."""
    if links.curves.shape[0] == 0:
        return decode_probability(ratio, links.threshold, links.distance_over_std[i, j])
    return probability_at(links.curves, links.row[i, j], ratio / links.threshold)


@compiled()
def broadcast(links: Links, air: Air, i: int) -> None:
    """Add i's packet to the air at every receiver."""
    for j in range(links.received_mw.shape[0]):
        transmit(air, i, j, links.received_mw[i, j], links.interference_mw[i, j])


@compiled()
def air_of(links: Links, transmits: Bool[np.ndarray, "N"]) -> Air:
    """Return the air when these robots transmit."""
    air = silent_air(transmits.shape[0])
    for i in range(transmits.shape[0]):
        if transmits[i]:
            broadcast(links, air, i)
    return air


@compiled()
def incoming_with(links: Links, air: Air, i: int, j: int) -> Incoming:
    """Return all packets at j when i transmits, too; a robot adds nothing at itself."""
    signal_mw, interference_mw = links.received_mw[i, j], links.interference_mw[i, j]
    return add_packet(incoming_at(air, j), i, signal_mw, interference_mw)


@compiled()
def chance_of_strongest(links: Links, incoming: Incoming, j: int) -> float:
    """Return the probability that j decodes the strongest packet."""
    others_mw = incoming.total - links.interference_mw[incoming.sender, j]
    ratio = sinr(incoming.strongest, others_mw, links.noise_mw)
    return chance(links, ratio, incoming.sender, j)


@compiled()
def listen(
    links: Links,
    air: Air,
    also: int,
    listens: Bool[np.ndarray, "N"],
    heard: Int[np.ndarray, "N"],
    probability: Float[np.ndarray, "N"],
) -> None:
    """Predict which packets robots may decode (Eqs. 3-4).

    All of `air` is in the air, and the packet of `also`, unless that is `NOBODY`. `heard` and
    `probability` are overwritten for all robots: by themselves, which is nobody, and by 0 for
    those that transmit or do not listen.
    """
    for j in range(listens.shape[0]):
        heard[j], probability[j] = j, 0.0
        if listens[j] and j != also:
            incoming = incoming_with(links, air, j if also == NOBODY else also, j)
            if incoming.strongest > 0.0:
                probability[j] = chance_of_strongest(links, incoming, j)
                heard[j] = incoming.sender if probability[j] > 0.0 else j


@compiled()
def lone_probabilities(links: Links) -> Float[np.ndarray, "N N"]:
    """Return the probability that j decodes i when nobody else transmits."""
    received_mw = links.received_mw
    probability = np.zeros_like(received_mw)
    for i in range(len(probability)):
        for j in range(len(probability)):
            if received_mw[i, j] > 0.0:
                ratio = sinr(received_mw[i, j], 0.0, links.noise_mw)
                probability[i, j] = chance(links, ratio, i, j)
    return probability
