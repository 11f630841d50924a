"""The channel that a mission's numbers make (IV-B), and the paper's part of it."""

import numpy as np

from swarm_mj.mission import Mission
from swarm_mj.physics.obstacles import Obstacles
from swarm_mj.radio.composed import ComposedChannel, Reception
from swarm_mj.radio.fading import NO_FADING, NO_LINE_OF_SIGHT, Bursts
from swarm_mj.radio.free_space import FreeSpaceRadio, from_db, transmit_power_dbm
from swarm_mj.radio.link_gains import LinkGains
from swarm_mj.radio.path_loss import FREE_SPACE, PathLoss, log_distance, two_ray_ground
from swarm_mj.radio.shadowing import Shadowing


def radio_of(mission: Mission) -> FreeSpaceRadio:
    """The mission's radio in free space: its power makes the range exact in silence (IV-B).

    It is the true channel of the paper's missions, and what robots believe in all others.
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
    radio = radio_of(mission)
    stands = obstacles is not None and len(obstacles.kind) > 0
    if not mission.beyond_free_space and not stands:
        return radio
    at_1_m_mw = np.full(mission.num_robots, radio.received_at_1_m_mw)
    at_1_m_mw[: mission.num_strong] *= from_db(mission.strong_db)
    shadowing = None
    if mission.shadowing_db > 0.0:
        shadowing = Shadowing(
            std_db=mission.shadowing_db, correlation_m=mission.shadowing_distance_m
        )
    return ComposedChannel(
        LinkGains(at_1_m_mw, _path_loss(mission), shadowing, obstacles if stands else None),
        Reception(
            noise_mw=radio.noise_mw,
            threshold=radio.threshold,
            rician_k=_rician_k(mission),
            erasure=mission.erasure,
            bursts=Bursts(begin=mission.burst_begin, end=mission.burst_end),
            recipient_hears_while_sending=radio.recipient_hears_while_sending,
        ),
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
