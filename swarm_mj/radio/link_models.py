"""Models of the channel that policies are given: the robots' belief, and the true statistics.

Neither foresees a fade. Index order: `i` sends, `j` receives.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.radio.composed import ComposedChannel, Reception
from swarm_mj.radio.decode_curves import KNOWN, Curves, decode_curves
from swarm_mj.radio.fading import NO_FADING
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.links import Links, doubtful, links_between
from swarm_mj.radio.power_law import FREE_SPACE_EXPONENT, PowerLaw, powers_between


@dataclass(frozen=True, kw_only=True, eq=False)
class Belief:
    """The channel as all robots of a mission believe it to be."""

    radio: FreeSpaceRadio
    law: PowerLaw | None = None  # of mean powers [mW]; None is that of free space
    reception: Reception | None = None  # the statistics of fades and losses; None: there are none
    shadowing_db: float = 0.0  # standard deviation of the powers' unknown part [dB]

    def law_over_noise(self, num_robots: int) -> PowerLaw:
        """Return the law of a team's mean powers, free space's too, in units of the noise."""
        at_1_m_mw = np.full(num_robots, self.radio.received_at_1_m_mw)
        law = PowerLaw(at_1_m_mw) if self.law is None else self.law
        return law._replace(at_1_m=law.at_1_m / self.radio.noise_mw)

    def links(
        self,
        position_m: Float[np.ndarray, "N 2"],
        spread_m: Float[np.ndarray, "N"] | None = None,
        is_known: Bool[np.ndarray, "N"] | None = None,
    ) -> Links:
        """Return the links between believed positions; arguments as of `links_between`."""
        links = links_between(self.radio, position_m, spread_m, is_known)
        if self.law is not None:
            links = _by_law(links, self.law, position_m, self.radio)
        return _with_chances(links, self.reception, self.shadowing_db)


@dataclass(frozen=True, kw_only=True)
class TrueLinks:
    """A channel before its fades: mean powers and statistics."""

    radio: FreeSpaceRadio
    channel: ComposedChannel | None = None  # None is the radio in free space

    def links(self, position_m: Float[np.ndarray, "N 2"], mission: int) -> Links:
        """Return the links between true positions of one mission, which has its own shadowing."""
        links = links_between(self.radio, position_m)
        if self.channel is None:
            return links
        powers_mw = self.channel.mean_powers_mw(position_m, mission)
        links = links._replace(received_mw=powers_mw, interference_mw=powers_mw)
        return _with_chances(links, self.channel.reception, 0.0)


def _by_law(
    links: Links, law: PowerLaw, position_m: Float[np.ndarray, "N 2"], radio: FreeSpaceRadio
) -> Links:
    """Return links of the same beliefs, but with the powers of a law."""
    is_counted = links.received_mw > 0.0
    # The steeper the path loss, the more dB an error of the distance is worth.
    is_far = links.received_mw < radio.received_at_1_m_mw / law.breakpoint_m**2
    steepness = np.where(is_far, law.exponent / FREE_SPACE_EXPONENT, 1.0)
    received_mw = powers_between(position_m, law) * is_counted
    return links._replace(
        received_mw=received_mw,
        interference_mw=received_mw,
        distance_over_std=links.distance_over_std / steepness,
    )


def _with_chances(links: Links, reception: Reception | None, std_db: float) -> Links:
    """Return the same links with the probabilities of their packets, where they are uncertain."""
    curves = KNOWN if reception is None else _curves(reception, is_certain=std_db == 0.0)
    if curves is KNOWN:
        return links
    return doubtful(links, curves, np.full(links.received_mw.shape, std_db))


@cache
def _curves(reception: Reception, *, is_certain: bool) -> Curves:
    """Return the curves of these statistics; `KNOWN` if packets decode for certain, or never."""
    begin, end = reception.burst_begin, reception.burst_end
    mean_loss = begin / (begin + end) if begin > 0.0 else 0.0  # share of slots in bursts
    success = (1.0 - reception.erasure) * (1.0 - mean_loss)
    if is_certain and reception.rician_k == NO_FADING and success == 1.0:
        return KNOWN
    return decode_curves(reception.rician_k, success)
