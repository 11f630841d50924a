"""The radio that a mission's numbers make (IV-B): its channel, and what policies know of it.

Belief and truth are models before fades, which neither foresees. Index order: `i` sends, `j`
receives.
"""

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.mission import Mission
from swarm_mj.mission.presets import beyond_free_space
from swarm_mj.physics.state import Obstacles
from swarm_mj.radio.asynchronous import AsynchronousChannel
from swarm_mj.radio.composed import ComposedChannel, Reception
from swarm_mj.radio.fading import NO_FADING, NO_LINE_OF_SIGHT
from swarm_mj.radio.free_space import Channel, FreeSpaceRadio, VaryingChannel, transmit_power_dbm
from swarm_mj.radio.links import KNOWN, Curves, Links, decode_curves, doubtful, links_between
from swarm_mj.radio.power_law import (
    FREE_SPACE_EXPONENT,
    TWO_RAY_EXPONENT,
    PowerLaw,
    free_space_law,
    two_ray_breakpoint_m,
)
from swarm_mj.system.decibels import from_db


@dataclass(frozen=True, kw_only=True, eq=False)
class Belief:
    """The channel as all robots of a mission believe it to be."""

    radio: FreeSpaceRadio
    law: PowerLaw | None = None  # of mean powers [mW]; None is that of free space
    reception: Reception | None = None  # the statistics of fades and losses; None: there are none
    shadowing_db: float = 0.0  # standard deviation of the powers' unknown part [dB]
    position_noise_m: float = 0.0  # standard deviation of robots' own positions, per axis [m]

    def law_over_noise(self, num_robots: int) -> PowerLaw:
        """Return the law of a team's mean powers, free space's too, in units of the noise."""
        law = self.law
        if law is None:
            law = free_space_law(self.radio.received_at_1_m_mw, num_robots)
        return law._replace(at_1_m=law.at_1_m / self.radio.noise_mw)

    def links(
        self,
        position_m: Float[np.ndarray, "N 2"],
        spread_m: Float[np.ndarray, "N"] | None = None,
        is_known: Bool[np.ndarray, "N"] | None = None,
    ) -> Links:
        """Return the links between believed positions; arguments as of `links_between`.

        Noise of robots' own positions adds to the spread.
        """
        if self.position_noise_m > 0.0:
            given_m = 0.0 if spread_m is None else spread_m
            spread_m = np.hypot(np.full(len(position_m), self.position_noise_m), given_m)
        links = links_between(self.radio, position_m, spread_m, is_known, self.law)
        return _with_chances(links, self.reception, self.shadowing_db)


@dataclass(frozen=True, kw_only=True)
class TrueLinks:
    """A channel before its fades: mean powers and statistics."""

    radio: FreeSpaceRadio
    channel: ComposedChannel | None = None  # None: in free space, or a user's own, which is unknown

    def links(self, position_m: Float[np.ndarray, "N 2"], mission: int) -> Links:
        """Return the links between true positions of one mission, which has its own shadowing."""
        links = links_between(self.radio, position_m)
        if self.channel is None:
            return links
        powers_mw = self.channel.mean_powers_mw(position_m, mission)
        links = links._replace(received_mw=powers_mw, interference_mw=powers_mw)
        return _with_chances(links, self.channel.reception, 0.0)


class MissionRadio(NamedTuple):
    """The channel that packets take, and the two models of it that policies are given."""

    channel: Channel | VaryingChannel
    belief: Belief  # of the robots: free space, and what the mission grants
    truth: TrueLinks  # for centralised policies


def radio_of(mission: Mission) -> FreeSpaceRadio:
    """Return the mission's radio in free space: its power makes the range exact in silence (IV-B).

    It is the true channel of the paper's missions, and what robots believe in all others, unless
    the mission grants more.
    """
    power_dbm = transmit_power_dbm(
        mission.range_m, mission.frequency_hz, mission.noise_dbm, mission.sinr_threshold_db
    )
    return FreeSpaceRadio(
        power_mw=from_db(power_dbm),
        noise_mw=from_db(mission.noise_dbm),
        threshold=from_db(mission.sinr_threshold_db),
        frequency_hz=mission.frequency_hz,
        recipient_hears_while_sending=mission.half_duplex == "eavesdroppers",
    )


def mission_radio(
    mission: Mission,
    obstacles: Obstacles | None = None,
    own: Channel | VaryingChannel | None = None,
) -> MissionRadio:
    """Return a mission's channel, belief and truth.

    A user's own channel takes the place of the mission's. Belief stays that of the mission, and
    truth is free space, as nothing else is known of such a channel unless it is a table.
    """
    radio, belief = radio_of(mission), _belief(mission, obstacles)
    if own is not None or not (beyond_free_space(mission) or obstacles is not None):
        channel = radio if own is None else own
        known = own if isinstance(own, ComposedChannel) else None  # a table of gains
        return MissionRadio(channel, belief, TrueLinks(radio=radio, channel=known))
    composed = ComposedChannel(
        _law(mission, radio, obstacles),
        _reception(mission, radio),
        shadowing_db=mission.shadowing_db,
        shadowing_distance_m=mission.shadowing_distance_m,
    )
    truth = TrueLinks(radio=radio, channel=composed)
    if not mission.clocks_differ:
        return MissionRadio(composed, belief, truth)
    offset, drift = mission.clock_offset_s / mission.slot_s, 1e-6 * mission.clock_drift_ppm
    return MissionRadio(AsynchronousChannel(composed, offset, drift), belief, truth)


def _belief(mission: Mission, obstacles: Obstacles | None) -> Belief:
    """Return what the mission grants to know of its channel."""
    known, belief = None, Belief(radio=radio_of(mission), position_noise_m=mission.position_noise_m)
    if obstacles is not None and mission.grants("map"):
        centre_m = obstacles.centre_m + np.array([mission.map_offset_m, 0.0, 0.0])
        known = obstacles._replace(centre_m=centre_m)
    if beyond_free_space(mission) and mission.grants("statistics"):
        law, reception = _law(mission, belief.radio, known), _reception(mission, belief.radio)
        shadowing_db = mission.shadowing_db
        return replace(belief, law=law, reception=reception, shadowing_db=shadowing_db)
    if known is not None:
        law = free_space_law(belief.radio.received_at_1_m_mw, mission.num_robots, known)
        return replace(belief, law=law)
    return belief


def by_robot(mission: Mission, default_mw: float) -> Float[np.ndarray, "N"]:
    """Return a power of each robot's packets where a default radio has this one [mW]."""
    power_mw = np.full(mission.num_robots, default_mw)
    power_mw[: mission.num_high_power] *= from_db(mission.high_power_db)
    return power_mw


def _law(mission: Mission, radio: FreeSpaceRadio, obstacles: Obstacles | None) -> PowerLaw:
    """Return the law of the mission's mean powers [mW] between these obstacles."""
    breakpoint_m, exponent = math.inf, FREE_SPACE_EXPONENT
    if mission.path_loss == "log-distance":  # Rappaport 2002, Eq. 4.69
        breakpoint_m, exponent = mission.reference_m, mission.loss_exponent
    elif mission.path_loss == "two-ray":
        breakpoint_m = two_ray_breakpoint_m(mission.antenna_height_m, mission.frequency_hz)
        exponent = TWO_RAY_EXPONENT
    at_1_m_mw = by_robot(mission, radio.received_at_1_m_mw)
    return PowerLaw(at_1_m_mw, breakpoint_m, exponent, obstacles)


def _reception(mission: Mission, radio: FreeSpaceRadio) -> Reception:
    rician_k = {"none": NO_FADING, "rayleigh": NO_LINE_OF_SIGHT, "rician": mission.rician_k}
    return Reception(
        noise_mw=radio.noise_mw,
        threshold=radio.threshold,
        rician_k=rician_k[mission.fading],
        erasure=mission.erasure,
        burst_begin=mission.burst_begin,
        burst_end=mission.burst_end,
        recipient_hears_while_sending=radio.recipient_hears_while_sending,
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
