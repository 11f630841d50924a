"""Reception (II-A): the rules that say which packet a robot decodes, and how probably.

The channels, the schedulers and the policies that predict receptions share them. Index order:
`i` sends, `j` receives. Powers are in one unit, whichever it is.
"""

import math
from typing import NamedTuple, cast

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.radio.fading import NO_FADING
from swarm_mj.system.compiled import compiled

# In place of a robot's index. A Python integer would be a type of its own to numba, which then
# compiles all that it reaches twice.
NOBODY = cast(int, np.int64(-1))
MIN_DISTANCE_M = 1e-3  # robots closer than this count as this far apart, which keeps gains finite
LOGISTIC_SLOPE = 1.702  # 1 / (1 + exp(-1.702 z)) is within 0.01 of the normal distribution function
CERTAIN = 2.5  # standard deviations beyond which a packet decodes for certain, or never


class Reception(NamedTuple):
    """The parameters that decide whether a packet of a given mean power decodes."""

    noise_mw: float  # sigma [mW]
    threshold: float  # least SINR that decodes, linear [1]
    rician_k: float = NO_FADING  # 0 is Rayleigh; linear [1]
    erasure: float = 0.0  # probability that a packet is lost on a link, whatever its power [1]
    burst_begin: float = 0.0  # probability per slot that a receiver loses all (`is_in_burst`)
    burst_end: float = 1.0  # that it hears again
    recipient_hears_while_sending: bool = False  # as `FreeSpaceRadio`'s


class Incoming(NamedTuple):
    """All packets of one slot at one receiver."""

    total: float  # power of all packets
    strongest: float  # power of the strongest that the receiver may decode; 0 is none
    sender: int  # of that packet; the receiver itself is nobody


class Air(NamedTuple):
    """All packets of one slot, at every receiver j: an `Incoming` for each."""

    total: Float[np.ndarray, "N"]
    strongest: Float[np.ndarray, "N"]
    sender: Int[np.ndarray, "N"]


@compiled()
def received_power(power_at_1_m: float, squared_distance_m2: float) -> float:
    """Return the power over a distance in free space, in the unit of that over 1 m (Eqs. 1-2)."""
    return power_at_1_m / max(squared_distance_m2, MIN_DISTANCE_M * MIN_DISTANCE_M)


@compiled()
def sinr(signal: float, interference: float, noise: float) -> float:
    """Return the signal over interference plus noise, linear [1] (Eq. 3)."""
    return signal / (noise + interference)


@compiled()
def is_received(ratio: float, threshold: float) -> bool:
    """Return whether a packet of this SINR decodes; ratio and threshold are linear [1] (Eq. 4)."""
    return ratio >= threshold


@compiled()
def may_decode(is_silent: bool, addressed: int, j: int, hears_while_sending: bool) -> bool:
    """Return whether half duplex lets robot j decode a packet that is addressed to some robot.

    A robot's own packet is interference to it, so a robot that is not silent hears nothing.
    By the authors' code it hears what is addressed to it all the same: `hears_while_sending`.
    """
    return is_silent or (hears_while_sending and addressed == j)


@compiled()
def add_packet(incoming: Incoming, i: int, signal: float, interference: float) -> Incoming:
    """Return what a receiver gets when i transmits, too.

    The signal is 0 where a receiver cannot decode a packet that jams it all the same by its
    interference: while it transmits, or where a scheduler does not count on the link.
    """
    # Two selections, not a branch: which packet is stronger is as random as the places of robots.
    is_stronger = signal > incoming.strongest  # of equally strong packets the first counts
    strongest = signal if is_stronger else incoming.strongest
    sender = i if is_stronger else incoming.sender
    return Incoming(incoming.total + interference, strongest, sender)


@compiled()
def decoded(incoming: Incoming, j: int, noise: float, threshold: float, factor: float = 1.0) -> int:
    """Return the sender that j decodes, or j: nobody; `factor` allows for more interference."""
    # The total less the signal, not a second sum: loops stay linear in the senders, and all callers
    # round alike, so that predictions agree with the channel to the last digit.
    interference = factor * (incoming.total - incoming.strongest)
    ratio = sinr(incoming.strongest, interference, noise)
    return incoming.sender if is_received(ratio, threshold) else j


@compiled()
def silent_air(num_robots: int) -> Air:
    """Return the air when nobody transmits."""
    return Air(np.zeros(num_robots), np.zeros(num_robots), np.arange(num_robots))


@compiled()
def incoming_at(air: Air, j: int) -> Incoming:
    """Return all packets at one receiver."""
    return Incoming(air.total[j], air.strongest[j], air.sender[j])


@compiled()
def add_to_air(air: Air, i: int, j: int, signal: float, interference: float) -> None:
    """Add i's packet to the air at j; powers as in `add_packet`."""
    incoming = add_packet(incoming_at(air, j), i, signal, interference)
    air.total[j] = incoming.total
    air.strongest[j] = incoming.strongest
    air.sender[j] = incoming.sender


@compiled()
def decode_probability(ratio: float, threshold: float, distance_over_std: float) -> float:
    """Return the probability that a packet over a believed distance decodes (Eqs. 3-4).

    A lone packet decodes up to some distance; interference shortens it to d sqrt(SINR /
    threshold), so a packet over a believed d comes through if the true distance is below that. The
    normal distribution is approximated by a logistic one.

    Args:
        ratio: The packet's SINR, if the receiver is as far away as is believed, linear [1].
        threshold: Least SINR that decodes, linear [1].
        distance_over_std: The believed distance over its standard deviation [1]; inf is certain.
    """
    if distance_over_std == np.inf:
        return 1.0 if is_received(ratio, threshold) else 0.0
    deviations = (math.sqrt(ratio / threshold) - 1.0) * distance_over_std
    if abs(deviations) > CERTAIN:
        return 1.0 if deviations > 0.0 else 0.0
    return 1.0 / (1.0 + math.exp(-LOGISTIC_SLOPE * deviations))
