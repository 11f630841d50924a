"""The radio that a mission's numbers make (IV-B): its channel, and what is believed of it."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from swarm_mj.mission import Mission
from swarm_mj.physics.state import Obstacles
from swarm_mj.radio.composed import ComposedChannel, Reception
from swarm_mj.radio.fading import NO_FADING, NO_LINE_OF_SIGHT
from swarm_mj.radio.free_space import (
    Channel,
    FreeSpaceRadio,
    VaryingChannel,
    from_db,
    transmit_power_dbm,
)
from swarm_mj.radio.link_gains import LinkGains
from swarm_mj.radio.link_models import Belief, TrueLinks
from swarm_mj.radio.power_law import (
    FREE_SPACE_EXPONENT,
    NO_OBSTACLES,
    TWO_RAY_EXPONENT,
    PowerLaw,
    two_ray_breakpoint_m,
)
from swarm_mj.radio.shadowing import Shadowing


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
    obstacles: Obstacles = NO_OBSTACLES,
    own: Channel | VaryingChannel | None = None,
) -> MissionRadio:
    """Return a mission's channel, belief and truth.

    Args:
        mission: Its numbers, and what it grants.
        obstacles: Of its scene.
        own: A user's channel in place of the mission's. Belief stays that of the mission, and truth
            is free space: nothing else is known of such a channel.
    """
    radio = radio_of(mission)
    law, reception = _law(mission, radio), _reception(mission, radio)
    channel: Channel | VaryingChannel = radio
    if own is not None:
        channel = own
    elif mission.beyond_free_space or len(obstacles.kind) > 0:
        gains = LinkGains(law._replace(obstacles=obstacles), _shadowing(mission))
        channel = ComposedChannel(gains, reception)
    known = obstacles if mission.grants("map") else NO_OBSTACLES
    belief = Belief(radio=radio)
    if mission.beyond_free_space and mission.grants("statistics"):
        belief = Belief(
            radio=radio,
            law=law._replace(obstacles=known),
            reception=reception,
            shadowing_db=mission.shadowing_db,
        )
    elif len(known.kind) > 0:
        everyone_mw = np.full(mission.num_robots, radio.received_at_1_m_mw)
        belief = Belief(radio=radio, law=PowerLaw(everyone_mw, obstacles=known))
    composed = channel if isinstance(channel, ComposedChannel) else None
    return MissionRadio(channel, belief, TrueLinks(radio=radio, channel=composed))


def by_robot(mission: Mission, default_mw: float) -> Float[np.ndarray, "N"]:
    """Return a power of each robot's packets where a default radio has this one [mW]."""
    power_mw = np.full(mission.num_robots, default_mw)
    power_mw[: mission.num_high_power] *= from_db(mission.high_power_db)
    return power_mw


def _law(mission: Mission, radio: FreeSpaceRadio) -> PowerLaw:
    """Return the law of the mission's mean powers [mW], shadowing and obstacles apart."""
    breakpoint_m, exponent = math.inf, FREE_SPACE_EXPONENT
    if mission.path_loss == "log-distance":  # Rappaport 2002, Eq. 4.69
        breakpoint_m, exponent = mission.reference_m, mission.loss_exponent
    elif mission.path_loss == "two-ray":
        breakpoint_m = two_ray_breakpoint_m(mission.antenna_height_m, mission.frequency_hz)
        exponent = TWO_RAY_EXPONENT
    return PowerLaw(by_robot(mission, radio.received_at_1_m_mw), breakpoint_m, exponent)


def _shadowing(mission: Mission) -> Shadowing | None:
    if mission.shadowing_db == 0.0:
        return None
    return Shadowing(std_db=mission.shadowing_db, correlation_m=mission.shadowing_distance_m)


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
