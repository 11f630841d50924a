"""The robots' radio: the power that it can decode and sense (II-A, IV-B)."""

from dataclasses import dataclass
from typing import TypedDict

from swarm_mj.mission.labels import CHANNEL, NEW
from swarm_mj.system.fields import setting

SENSED_ABOVE_NOISE_DB = 3.0  # of a preamble that its gain has lifted, or noise hides it


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
        "noise power; transmit power changes with it, so the range stays",
        label="noise power",
        unit="dBm",
        low=-200.0,
        high=50.0,
        source="IV-B",
        group=CHANNEL,
    )
    sensing_dbm: float | None = setting(
        None,
        "power that csma, age-gain-csma and index-csma sense",
        label="sensing threshold",
        unit="dBm",
        low=-200.0,
        high=50.0,
        source=NEW,
        group=CHANNEL,
    )
    sensing_gain_db: float = setting(
        10.0,  # an 11-chip Barker code, as of IEEE 802.11, has 10.4
        "how far a known preamble is lifted out of the noise where robots sense",
        label="sensing gain",
        unit="dB",
        low=0.0,
        high=40.0,
        source=NEW,
        group=CHANNEL,
    )
    sensing_miss: float = setting(
        0.0,
        "probability that a robot senses nothing in a slot",
        label="missed detection",
        unit="per slot",
        low=0.0,
        high=1.0,
        source=NEW,
        group=CHANNEL,
    )
    sensing_false_alarm: float = setting(
        0.0,
        "probability that it senses a busy channel in any case",
        label="false alarm",
        unit="per slot",
        low=0.0,
        high=1.0,
        source=NEW,
        group=CHANNEL,
    )
    minislots: int = setting(
        64,
        "moments of a slot in which robots that sense may begin",
        label="number of minislots",
        unit="per slot",
        low=1,
        high=1024,
        source=NEW,
        group=CHANNEL,
    )
    minislot_us: float = setting(
        20.0,
        "length of one; packets of policies that sense have the rest of the slot",
        label="minislot",
        unit="µs",
        low=0.0,
        high=500.0,
        source="IEEE 802.11, direct sequence",
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

    @property
    def sensing_floor_dbm(self) -> float:
        """Least power that robots can sense [dBm]."""
        return self.noise_dbm + SENSED_ABOVE_NOISE_DB - self.sensing_gain_db

    @property
    def contention_s(self) -> float:
        """Length of the minislots at the start of a slot, where robots sense [s]."""
        return self.minislots * self.minislot_us / 1e6


class TransceiverFields(TypedDict, total=False):
    """Keywords for the fields of `Transceiver`, as `mission.keywords` explains."""

    sinr_threshold_db: float
    noise_dbm: float
    sensing_dbm: float | None
    sensing_gain_db: float
    sensing_miss: float
    sensing_false_alarm: float
    minislots: int
    minislot_us: float
    frequency_hz: float
