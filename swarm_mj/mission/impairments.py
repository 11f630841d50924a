"""Impairments that the paper's radio has not: lost packets, unequal power, clocks that differ."""

from dataclasses import dataclass
from typing import TypedDict

from swarm_mj.mission.labels import CHANNEL, NEW
from swarm_mj.mission.team import Team
from swarm_mj.system.fields import above_zero, setting


@dataclass(frozen=True, kw_only=True)
class Impairments(Team):
    """Losses of packets, robots with more power, and clocks."""

    # Packets lost at random, one by one or in bursts.
    erasure: float = setting(
        0.0,
        "share of packets lost at each receiver",
        label="erasure probability",
        low=0.0,
        high=0.99,
        source=NEW,
        group=CHANNEL,
    )
    burst_begin: float = setting(
        0.0,
        "probability that a receiver stops receiving",
        label="burst begin",
        unit="per slot",
        low=0.0,
        high=0.5,
        source=NEW,
        group=CHANNEL,
    )
    burst_end: float = setting(
        0.05,
        "probability that it receives again",
        label="burst end",
        unit="per slot",
        low=0.001,
        high=0.5,
        source=NEW,
        group=CHANNEL,
        counts_with=above_zero(burst_begin),
    )

    # Robots with more transmit power.
    high_power_fraction: float = setting(
        0.0,
        "robots with extra transmit power",
        label="high-power fraction",
        unit="of the team",
        low=0.0,
        high=1.0,
        source=NEW,
        former=("strong_share",),
        group=CHANNEL,
    )
    high_power_db: float = setting(
        6.0,
        "extra transmit power",
        label="extra power",
        unit="dB",
        low=0.0,
        high=60.0,
        source=NEW,
        former=("strong_db",),
        group=CHANNEL,
        counts_with=above_zero(high_power_fraction),
    )

    # Clocks.
    clock_offset_s: float = setting(
        0.0,
        "largest difference between clocks",
        label="clock offset",
        unit="s",
        low=0.0,
        high=10.0,
        source=NEW,
        group=CHANNEL,
    )
    clock_drift_ppm: float = setting(
        0.0,
        "largest drift of a clock",
        label="clock drift",
        unit="ppm",
        low=0.0,
        high=10_000.0,
        source=NEW,
        group=CHANNEL,
    )

    @property
    def num_high_power(self) -> int:
        """Number of robots with more transmit power: the first ones, to the nearest."""
        has_more = self.high_power_db > 0.0
        return round(self.high_power_fraction * self.num_robots) if has_more else 0

    @property
    def clocks_differ(self) -> bool:
        """True if robots' slots begin at different times (VI)."""
        return self.clock_offset_s > 0.0 or self.clock_drift_ppm > 0.0


class ImpairmentsFields(TypedDict, total=False):
    """Keywords for the fields of `Impairments`, as `mission.keywords` explains."""

    erasure: float
    burst_begin: float
    burst_end: float
    high_power_fraction: float
    high_power_db: float
    clock_offset_s: float
    clock_drift_ppm: float
