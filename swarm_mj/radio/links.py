"""Links as a scheduler believes in them, and the receptions it predicts over them (Eqs. 3-4).

A fade, an error of the belief in mean powers, or both make of `is_received` a probability that
rises with the margin: the SINR of the mean powers over the threshold, in dB. Index order: `i`
sends, `j` receives.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.radio.fading import NO_FADING, NO_LINE_OF_SIGHT
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.power_law import (
    FREE_SPACE_EXPONENT,
    PowerLaw,
    breakpoint_between,
    free_space_law,
    places_of,
    powers_between,
)
from swarm_mj.radio.reception import (
    CERTAIN,
    MIN_DISTANCE_M,
    NOBODY,
    Air,
    Incoming,
    add_packet,
    add_to_air,
    decode_probability,
    incoming_at,
    silent_air,
    sinr,
)
from swarm_mj.system.compiled import compiled
from swarm_mj.system.decibels import DB_PER_NEPER, from_db

NUM_RATIOS = 1024  # steps of x = r / (1 + r), where r is the SINR over the threshold
MAX_MARGIN_DB = 80.0  # up to which a fade's own distribution is worked out
FINE_STEP_DB = 0.01  # and how finely
STD_STEP_DB = 0.5
MAX_STD_DB = 12.0
SIGMAS = 4.0  # how far a normal distribution is followed
SIGMA_STEP = 0.05  # and how finely
LEAST_PROBABILITY = 0.02  # what is less counts as 0, which spares schedulers hopeless links

ROUNDING = 1e-9  # more than sums, products and chances lose by rounding, as a share

Curves = Float[np.ndarray, "S R"]  # a probability for each standard deviation and each SINR

KNOWN = np.zeros((0, 0))  # instead of curves: powers are known but for the positions


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


def among(links: Links, takes_part: Bool[np.ndarray, "N"]) -> Links:
    """Return the links without those of robots that neither send nor hear, such as failed ones."""
    both = takes_part[:, np.newaxis] & takes_part
    return links._replace(
        received_mw=np.where(both, links.received_mw, 0.0),
        interference_mw=np.where(both, links.interference_mw, 0.0),
    )


def links_between(
    radio: FreeSpaceRadio,
    position_m: Float[np.ndarray, "N D"],
    spread_m: Float[np.ndarray, "N"] | None = None,
    is_known: Bool[np.ndarray, "N"] | None = None,
    law: PowerLaw | None = None,
) -> Links:
    """Return the links between robots at believed positions.

    Args:
        radio: Whose powers, noise and threshold they have.
        position_m: Where each robot is believed to be [m], [N D].
        spread_m: Standard deviation of each belief [m], [N]; None: the positions are true.
        is_known: Whether a robot is known to be anywhere, [N]; others hear nothing and are not
            heard. None: everyone is known.
        law: Of mean powers [mW]; None: the radio's in free space.

    Returns:
        The links, without doubts about powers.
    """
    num_robots = len(position_m)
    if law is None:
        law = free_space_law(radio.received_at_1_m_mw, num_robots)
    received_mw = powers_between(position_m, law)
    if is_known is not None:
        received_mw *= is_known[:, None] & is_known[None, :]
    distance_over_std = np.full((num_robots, num_robots), np.inf)
    if spread_m is not None:
        antenna_m = places_of(law.antennas, position_m)
        apart_m = antenna_m[:, None] - antenna_m[None, :]
        distance_m = np.maximum(np.sqrt(np.sum(apart_m**2, axis=2)), MIN_DISTANCE_M)
        variance_m2 = spread_m[:, None] ** 2 + spread_m[None, :] ** 2
        np.divide(distance_m, np.sqrt(variance_m2), out=distance_over_std, where=variance_m2 > 0.0)
        if law.breakpoint_m < np.inf:
            # The steeper the path loss, the more dB an error of the distance is worth.
            is_steeper = distance_m > _breakpoints_between(antenna_m, law)
            distance_over_std /= np.where(is_steeper, law.exponent / FREE_SPACE_EXPONENT, 1.0)
    return Links(
        received_mw=received_mw,
        distance_over_std=distance_over_std,
        noise_mw=radio.noise_mw,
        threshold=radio.threshold,
        curves=KNOWN,
        row=np.zeros((num_robots, num_robots), dtype=np.int64),
        interference_mw=received_mw,
    )


@compiled()
def _breakpoints_between(
    antenna_m: Float[np.ndarray, "N D"], law: PowerLaw
) -> Float[np.ndarray, "N N"]:
    """Return up to where free space holds between all pairs of antennas [m]."""
    num_robots = antenna_m.shape[0]
    breakpoint_m = np.empty((num_robots, num_robots))
    for i in range(num_robots):
        for j in range(num_robots):
            breakpoint_m[i, j] = breakpoint_between(antenna_m, i, j, law)
    return breakpoint_m


def doubtful(links: Links, curves: Curves, std_db: Float[np.ndarray, "N N"]) -> Links:
    """Return the same links over a channel that fades, or whose powers are known up to an error.

    That error's standard deviation is in dB, without what positions add to it.
    """
    std_db = np.hypot(std_db, 2.0 * DB_PER_NEPER / links.distance_over_std)
    row = np.rint(np.minimum(std_db, MAX_STD_DB) / STD_STEP_DB).astype(np.int64)
    return links._replace(curves=curves, row=row)


@compiled(forceinline=True)
def chance(links: Links, ratio: float, i: int, j: int) -> float:
    """Return the probability that j decodes i at this SINR, linear [1]."""
    if links.curves.shape[0] == 0:
        return decode_probability(ratio, links.threshold, links.distance_over_std[i, j])
    return probability_at(links.curves, links.row[i, j], ratio / links.threshold)


@compiled()
def broadcast(links: Links, air: Air, i: int) -> None:
    """Add i's packet to the air at every receiver."""
    for j in range(links.received_mw.shape[0]):
        add_to_air(air, i, j, links.received_mw[i, j], links.interference_mw[i, j])


@compiled()
def air_of(links: Links, transmits: Bool[np.ndarray, "N"]) -> Air:
    """Return the air when these robots transmit."""
    air = silent_air(transmits.shape[0])
    for i in range(transmits.shape[0]):
        if transmits[i]:
            broadcast(links, air, i)
    return air


@compiled(forceinline=True)
def incoming_with(links: Links, air: Air, i: int, j: int) -> Incoming:
    """Return all packets at j when i transmits, too; a robot adds nothing at itself."""
    signal_mw = links.received_mw[i, j]
    interference_mw = links.interference_mw[i, j]
    return add_packet(incoming_at(air, j), i, signal_mw, interference_mw)


@compiled(forceinline=True)
def chance_of_strongest(links: Links, incoming: Incoming, j: int) -> float:
    """Return the probability that j decodes the strongest packet."""
    others_mw = incoming.total - links.interference_mw[incoming.sender, j]
    ratio = sinr(incoming.strongest, others_mw, links.noise_mw)
    return chance(links, ratio, incoming.sender, j)


@compiled(forceinline=True)
def room_for_interference(links: Links, incoming: Incoming, j: int) -> float:
    """Return what interference silences j for certain, rounding included [mW]; inf with curves."""
    if links.curves.shape[0] > 0:
        return np.inf
    certain = CERTAIN / links.distance_over_std[incoming.sender, j] + ROUNDING
    limit_mw = incoming.strongest / (links.threshold * max(1.0 - certain, 0.0) ** 2)
    others_mw = incoming.total * (1.0 - ROUNDING) - links.interference_mw[incoming.sender, j]
    return limit_mw - others_mw - links.noise_mw * (1.0 - ROUNDING)


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
    those that transmit or do not listen. Not `reception.decoded`: a chance takes its place, and
    what is not counted on as a signal interferes all the same.
    """
    for j in range(listens.shape[0]):
        heard[j] = j
        probability[j] = 0.0
        if listens[j] and j != also:
            added = j if also == NOBODY else also  # j adds nothing at itself
            incoming = incoming_with(links, air, added, j)
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


def decode_curves(rician_k: float = NO_FADING, success: float = 1.0) -> Curves:
    """Return the probability that a packet decodes, if one of enough power does with `success`.

    Rows are standard deviations of the believed power from 0 to `MAX_STD_DB`. Columns are ratios r
    of the SINR to the threshold from 0 to infinity, evenly spaced in r / (1 + r).
    """
    share = np.arange(NUM_RATIOS + 1) / NUM_RATIOS
    with np.errstate(divide="ignore"):
        margin_db = 10.0 * (np.log10(share) - np.log10(1.0 - share))
    z = np.arange(-SIGMAS, SIGMAS + SIGMA_STEP / 2, SIGMA_STEP)
    weight = np.exp(-0.5 * z**2)
    weight /= weight.sum()
    num_fine = round(MAX_MARGIN_DB / FINE_STEP_DB)
    fine_db = np.arange(-num_fine, num_fine + 1) * FINE_STEP_DB
    exceeds = _fade_exceeds(fine_db, rician_k)
    std_db = STD_STEP_DB * np.arange(round(MAX_STD_DB / STD_STEP_DB) + 1)
    rows = [
        np.interp(margin_db[:, None] + std * z[None, :], fine_db, exceeds) @ weight
        for std in std_db.tolist()
    ]
    curves = success * np.stack(rows)
    return np.where(curves < LEAST_PROBABILITY, 0.0, curves)


@compiled()
def probability_at(curves: Curves, row: int, ratio: float) -> float:
    """Return the probability that a packet decodes; the ratio is SINR to threshold, linear [1]."""
    return curves[row, int(ratio / (1.0 + ratio) * NUM_RATIOS + 0.5)]


def _fade_exceeds(margin_db: Float[np.ndarray, "M"], rician_k: float) -> Float[np.ndarray, "M"]:
    """Return the probability that a fade leaves more than what a margin can spare."""
    least = from_db(-margin_db)  # of the mean power
    if rician_k == NO_FADING:
        return (least <= 1.0).astype(np.float64)
    if rician_k == NO_LINE_OF_SIGHT:
        return np.exp(-least)
    from scipy.special import chndtr  # slow to import

    # The power, times 2 (K + 1), is non-central chi-squared with two degrees of freedom.
    return 1.0 - chndtr(2.0 * (rician_k + 1.0) * least, 2.0, 2.0 * rician_k)
