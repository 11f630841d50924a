"""The channel that a mission's numbers make (IV-B), and the paper's part of it."""

import numpy as np
from jaxtyping import Float

from swarm_mj.mission import Mission
from swarm_mj.physics.state import Obstacles
from swarm_mj.radio.composed import ComposedChannel, Reception
from swarm_mj.radio.fading import NO_FADING, NO_LINE_OF_SIGHT, Bursts
from swarm_mj.radio.free_space import (
    Channel,
    FreeSpaceRadio,
    VaryingChannel,
    from_db,
    transmit_power_dbm,
)
from swarm_mj.radio.link_gains import LinkGains
from swarm_mj.radio.link_models import Belief, TrueLinks
from swarm_mj.radio.path_loss import FREE_SPACE, PathLoss, log_distance, two_ray_ground
from swarm_mj.radio.power_law import PowerLaw, power_law
from swarm_mj.radio.shadowing import Shadowing


def radio_of(mission: Mission) -> FreeSpaceRadio:
    """Return the mission's radio in free space: its power makes the range exact in silence (IV-B).

    It is the true channel of the paper's missions, and what robots believe in all others, unless
    they are told more (`belief_of`).
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


def channel_of(
    mission: Mission, obstacles: Obstacles | None = None
) -> FreeSpaceRadio | ComposedChannel:
    """Who decodes whom in a mission: the radio in free space, or with what is added to it.

    Args:
        mission: Its numbers.
        obstacles: What stands in the way in its scene.

    Returns:
        The channel; one of free space if nothing was added.
    """
    if not mission.beyond_free_space and not _stands(obstacles):
        return radio_of(mission)
    shadowing = None
    if mission.shadowing_db > 0.0:
        shadowing = Shadowing(
            std_db=mission.shadowing_db, correlation_m=mission.shadowing_distance_m
        )
    return ComposedChannel(LinkGains(_law(mission, obstacles), shadowing), _reception(mission))


def belief_of(mission: Mission, obstacles: Obstacles | None = None) -> Belief:
    """What the robots of a mission take the channel for: free space, and what they were told.

    Args:
        mission: Its numbers, and what it grants.
        obstacles: What stands in the way in its scene.

    Returns:
        The belief.
    """
    radio = radio_of(mission)
    told = obstacles if mission.grants("map") else None
    if not (mission.grants("statistics") and mission.beyond_free_space):
        everyone_mw = np.full(mission.num_robots, radio.received_at_1_m_mw)
        law = power_law(everyone_mw, obstacles=told) if _stands(told) else None
        return Belief(radio=radio, law=law)
    return Belief(
        radio=radio,
        law=_law(mission, told),
        reception=_reception(mission),
        shadowing_db=mission.shadowing_db,
    )


def truth_of(mission: Mission, channel: Channel | VaryingChannel) -> TrueLinks:
    """What there is to know of a mission's channel; of a user's own, nothing but free space."""
    own = channel if isinstance(channel, ComposedChannel) else None
    return TrueLinks(radio=radio_of(mission), channel=own)


def by_robot(mission: Mission, usual_mw: float) -> Float[np.ndarray, "N"]:
    """Return a power of each robot's packets where a usual radio has this one [mW]."""
    power_mw = np.full(mission.num_robots, usual_mw)
    power_mw[: mission.num_high_power] *= from_db(mission.high_power_db)
    return power_mw


def _stands(obstacles: Obstacles | None) -> bool:
    """Whether anything stands in the way."""
    return obstacles is not None and len(obstacles.kind) > 0


def _law(mission: Mission, obstacles: Obstacles | None) -> PowerLaw:
    """Of the mission's mean powers [mW], shadowing apart, with these obstacles."""
    at_1_m_mw = by_robot(mission, radio_of(mission).received_at_1_m_mw)
    return power_law(at_1_m_mw, _path_loss(mission), obstacles)


def _reception(mission: Mission) -> Reception:
    radio = radio_of(mission)
    return Reception(
        noise_mw=radio.noise_mw,
        threshold=radio.threshold,
        rician_k=_rician_k(mission),
        erasure=mission.erasure,
        bursts=Bursts(begin=mission.burst_begin, end=mission.burst_end),
        recipient_hears_while_sending=radio.recipient_hears_while_sending,
    )


def _path_loss(mission: Mission) -> PathLoss:
    if mission.path_loss == "log-distance":
        return log_distance(mission.loss_exponent, mission.reference_m)
    if mission.path_loss == "two-ray":
        return two_ray_ground(mission.antenna_height_m, mission.frequency_hz)
    return FREE_SPACE


def _rician_k(mission: Mission) -> float:
    if mission.fading == "none":
        return NO_FADING
    return NO_LINE_OF_SIGHT if mission.fading == "rayleigh" else mission.rician_k
