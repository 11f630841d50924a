"""The channel that a mission's numbers make (IV-B)."""

from swarm_mj.mission import Mission
from swarm_mj.radio.free_space import FreeSpaceRadio, from_db, transmit_power_dbm


def radio_of(mission: Mission) -> FreeSpaceRadio:
    """The mission's radio, its power such that the range is exact in silence (IV-B)."""
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
