"""The radio that a mission's numbers make (IV-B): its channel, and what policies know of it.

Belief and truth are models before fades, which neither foresees. Index order: `i` sends, `j`
receives.
"""

from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.mission import Mission
from swarm_mj.physics.state import Antennas, Obstacles
from swarm_mj.radio.asynchronous import AsynchronousChannel
from swarm_mj.radio.composed import ComposedChannel
from swarm_mj.radio.effect import Effect
from swarm_mj.radio.effects import BodyAntennas, Obstruction, effects_of, model_of
from swarm_mj.radio.fading import NO_FADING
from swarm_mj.radio.free_space import Channel, FreeSpaceRadio, VaryingChannel, transmit_power_dbm
from swarm_mj.radio.links import KNOWN, Curves, Links, decode_curves, doubtful, links_between
from swarm_mj.radio.power_law import PowerLaw, free_space_law, powers_between
from swarm_mj.radio.reception import Reception
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
        position_m: Float[np.ndarray, "N D"],
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

    def mean_powers_mw(
        self, position_m: Float[np.ndarray, "N D"], mission: int
    ) -> Float[np.ndarray, "N N"]:
        """Return the power of each robot of a mission at each other before fades [mW]."""
        if self.channel is None:
            law = free_space_law(self.radio.received_at_1_m_mw, len(position_m))
            return powers_between(position_m, law)
        return self.channel.mean_powers_mw(position_m, mission)

    def links(self, position_m: Float[np.ndarray, "N D"], mission: int) -> Links:
        """Return the links between true positions of one mission, which has its own shadowing."""
        links = links_between(self.radio, position_m)
        if self.channel is None:
            return links
        powers_mw = self.mean_powers_mw(position_m, mission)
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

    Args:
        mission: Whose range, frequency, noise, SINR threshold and half duplex it has.

    Returns:
        A channel, whose numbers (`power_mw`, `noise_mw`, `threshold`) serve channels of your own.

    Example:
        >>> from swarm_mj import paper
        >>> from swarm_mj.radio.mission_radio import radio_of
        >>> round(radio_of(paper()).power_mw)
        7967
    """
    power_dbm = transmit_power_dbm(
        mission.range_m, mission.frequency_hz, mission.noise_dbm, mission.sinr_threshold_db
    )
    return FreeSpaceRadio(
        power_mw=from_db(power_dbm),
        noise_mw=from_db(mission.noise_dbm),
        threshold=from_db(mission.sinr_threshold_db),
        frequency_hz=mission.frequency_hz,
        recipient_hears_while_sending=mission.recipient_hears_while_sending,
    )


def mission_radio(
    mission: Mission,
    obstacles: Obstacles | None = None,
    own: Channel | VaryingChannel | None = None,
) -> MissionRadio:
    """Return a mission's channel, belief and truth; the models of its robots have their antennas.

    Args:
        mission: Whose numbers make them.
        obstacles: What stands in the scene and takes power from packets.
        own: A user's channel, which takes the place of the mission's. Belief stays that of the
            mission, and truth is free space, as nothing else is known of such a channel unless it
            is a table of gains.

    Returns:
        The channel, which is to be started if it has a `start`, and the two models of it.

    Raises:
        ValueError: The model of a robot is refused.
    """
    radio = radio_of(mission)
    antennas = team_antennas(mission)
    belief = _belief(mission, radio, obstacles, antennas)
    if own is not None:
        known = own if isinstance(own, ComposedChannel) else None  # a table of gains
        return MissionRadio(own, belief, TrueLinks(radio=radio, channel=known))
    effects: list[Effect] = [*effects_of(mission)]
    if obstacles is not None:
        effects.append(Obstruction(obstacles=obstacles))
    effects = _with_antennas(effects, antennas)
    if not effects:
        return MissionRadio(radio, belief, TrueLinks(radio=radio))
    model = model_of(radio, mission.num_robots, effects)
    composed = ComposedChannel(
        model.law,
        model.reception,
        shadowing_db=model.shadowing_db,
        shadowing_distance_m=model.shadowing_distance_m,
        num_axes=mission.num_axes,
    )
    truth = TrueLinks(radio=radio, channel=composed)
    if model.clock_offset == 0.0 and model.clock_drift == 0.0:
        return MissionRadio(composed, belief, truth)
    asynchronous = AsynchronousChannel(composed, model.clock_offset, model.clock_drift)
    return MissionRadio(asynchronous, belief, truth)


def team_antennas(mission: Mission) -> Antennas | None:
    """Return the antennas that robots' models declare; None of points, or if none does."""
    if not mission.has_bodies:
        return None
    from swarm_mj.physics.robots import antennas_of  # MuJoCo is slow to import

    return antennas_of(mission)


def _with_antennas(effects: list[Effect], antennas: Antennas | None) -> list[Effect]:
    """Return a channel's effects and its antennas, unless these change nothing there."""
    if antennas is None or (antennas.are_alike and not effects):
        return effects
    return [*effects, BodyAntennas(antennas=antennas)]


def _belief(
    mission: Mission,
    radio: FreeSpaceRadio,
    obstacles: Obstacles | None,
    antennas: Antennas | None,
) -> Belief:
    """Return what the mission grants to know of its channel; antennas are of its statistics."""
    known: list[Effect] = []
    if mission.grants("statistics"):
        known.extend(effects_of(mission))
    if mission.grants("map") and obstacles is not None:
        centre_m = obstacles.centre_m + np.array([mission.map_offset_m, 0.0, 0.0])
        known.append(Obstruction(obstacles=obstacles._replace(centre_m=centre_m)))
    if mission.grants("statistics"):
        known = _with_antennas(known, antennas)
    belief = Belief(radio=radio, position_noise_m=mission.position_noise_m)
    if not known:
        return belief
    model = model_of(radio, mission.num_robots, known)
    return replace(
        belief, law=model.law, reception=model.reception, shadowing_db=model.shadowing_db
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
    begin = reception.burst_begin
    end = reception.burst_end
    mean_loss = begin / (begin + end) if begin > 0.0 else 0.0  # share of slots in bursts
    success = (1.0 - reception.erasure) * (1.0 - mean_loss)
    if is_certain and reception.rician_k == NO_FADING and success == 1.0:
        return KNOWN
    return decode_curves(reception.rician_k, success)
