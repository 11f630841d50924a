"""The robots' radio: the power that it can decode and sense (II-A, IV-B)."""

from dataclasses import dataclass
from typing import TypedDict

from swarm_mj.mission.labels import CHANNEL, NEW
from swarm_mj.system.fields import setting


@dataclass(frozen=True, kw_only=True)
class Transceiver:
    """The radio that every robot has."""

    sinr_threshold_db: float = setting(
        1.0,  # the paper writes "1 dBm", but a threshold on a ratio is a ratio
        "least SINR that decodes",
        label="SINR threshold",
        unit="dB",
        low=-30.0,
        high=60.0,
        source="IV-B",
        group=CHANNEL,
    )
    noise_dbm: float = setting(
        -50.0,
        "transmit power follows it",
        label="noise power",
        unit="dBm",
        low=-200.0,
        high=50.0,
        source="IV-B",
        group=CHANNEL,
    )
    sensing_dbm: float | None = setting(
        None,
        "power that csma and age-gain-csma sense",
        label="sensing threshold",
        unit="dBm",
        low=-200.0,
        high=50.0,
        source=NEW,
        group=CHANNEL,
    )
    frequency_hz: float = setting(
        2.4e9,
        label="centre frequency",
        unit="Hz",
        low=1e6,
        high=1e12,
        source="IV-B",
    )


class TransceiverFields(TypedDict, total=False):
    """Keywords for the fields of `Transceiver`, as `mission.keywords` explains."""

    sinr_threshold_db: float
    noise_dbm: float
    sensing_dbm: float | None
    frequency_hz: float
