"""Effects of a channel beyond the paper's free space, from path loss to clocks, each in one place.

From `EFFECTS`, the list of all, follow the channel that a mission flies, its title, what robots may
know of it, and the table of `docs/channels.md`, whose sentences are the classes' own.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import assert_never

from swarm_mj.mission import Mission
from swarm_mj.physics.state import Antennas, Obstacles
from swarm_mj.radio.effect import ChannelModel, Effect, MissionEffect, titled
from swarm_mj.radio.fading import NO_LINE_OF_SIGHT
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.power_law import (
    TWO_RAY_EXPONENT,
    free_space_law,
    two_ray_breakpoint_m,
)
from swarm_mj.radio.reception import Reception
from swarm_mj.system.decibels import from_db


@dataclass(frozen=True, kw_only=True, eq=False)
class PathLoss(
    MissionEffect, reads=("path_loss", "loss_exponent", "reference_m", "antenna_height_m")
):
    """Mean power falls as in free space up to a distance, and more steeply beyond it.

    `log-distance`: 10 n dB for every tenfold distance beyond the reference distance. `two-ray`: 40
    dB per decade beyond the crossover distance, as the reflection from the ground nearly cancels
    the direct ray (both: Rappaport 2002); robots with bodies have antennas at their own heights.
    """

    # To add a law, name it in `PathLossLaw` and its parameters in `mission.surroundings`; here it
    # gets a case.
    breakpoint_m: float  # up to which free space holds
    exponent: float  # n, beyond it: tenfold distance costs 10 n dB
    is_by_height: bool = False  # whether both antennas' heights [m] multiply the breakpoint

    @classmethod
    def of(cls, mission: Mission) -> "PathLoss | None":
        """Return the law that a mission names; None is free space."""
        law = mission.path_loss
        match law:
            case "free-space":
                return None
            case "log-distance":  # Rappaport 2002, Eq. 4.69
                return cls(
                    title=titled(mission, "path_loss", "loss_exponent", "reference_m"),
                    breakpoint_m=mission.reference_m,
                    exponent=mission.loss_exponent,
                )
            case "two-ray" if mission.has_bodies:
                return cls(
                    title=titled(mission, "path_loss"),
                    breakpoint_m=two_ray_breakpoint_m(1.0, mission.frequency_hz),
                    exponent=TWO_RAY_EXPONENT,
                    is_by_height=True,
                )
            case "two-ray":
                height_m = mission.antenna_height_m
                return cls(
                    title=titled(mission, "path_loss", "antenna_height_m"),
                    breakpoint_m=two_ray_breakpoint_m(height_m, mission.frequency_hz),
                    exponent=TWO_RAY_EXPONENT,
                )
            case _:
                assert_never(law)

    def change(self, model: ChannelModel) -> ChannelModel:
        """Return a channel whose mean powers follow this law."""
        law = model.law._replace(
            breakpoint_m=self.breakpoint_m,
            exponent=self.exponent,
            is_by_height=self.is_by_height,
        )
        return model._replace(law=law)


@dataclass(frozen=True, kw_only=True, eq=False)
class Shadowing(MissionEffect, reads=("shadowing_db", "shadowing_distance_m")):
    """Mean power is log-normal, the same in both directions.

    Its correlation falls to 1/e as one end of a link moves by the shadowing distance (Gudmundson
    1991; for two ends that move, Wang, Tameh and Nix 2008).
    """

    std_db: float
    distance_m: float

    @classmethod
    def of(cls, mission: Mission) -> "Shadowing | None":
        """Return the shadowing, if it has any deviation."""
        if mission.shadowing_db == 0.0:
            return None
        return cls(
            title=titled(mission, "shadowing_db", "shadowing_distance_m"),
            std_db=mission.shadowing_db,
            distance_m=mission.shadowing_distance_m,
        )

    def change(self, model: ChannelModel) -> ChannelModel:
        """Return a channel whose mean powers are drawn with this deviation."""
        return model._replace(shadowing_db=self.std_db, shadowing_distance_m=self.distance_m)


@dataclass(frozen=True, kw_only=True, eq=False)
class Fading(MissionEffect, reads=("fading", "rician_k")):
    """The power of each link is drawn anew in each slot, the same in both directions.

    `rayleigh`: without a line of sight. `rician`: K is the power of the line of sight over that of
    all scattered waves.
    """

    rician_k: float  # linear [1]

    @classmethod
    def of(cls, mission: Mission) -> "Fading | None":
        """Return the law that a mission names."""
        law = mission.fading
        match law:
            case "none":
                return None
            case "rayleigh":
                return cls(title=titled(mission, "fading"), rician_k=NO_LINE_OF_SIGHT)
            case "rician":
                return cls(
                    title=titled(mission, "fading", "rician_k"),
                    rician_k=mission.rician_k,
                )
            case _:
                assert_never(law)

    def change(self, model: ChannelModel) -> ChannelModel:
        """Return a channel whose links fade."""
        return model._replace(reception=model.reception._replace(rician_k=self.rician_k))


@dataclass(frozen=True, kw_only=True, eq=False)
class Erasure(MissionEffect, reads=("erasure",)):
    """Each receiver loses a share `erasure` of the packets that it would decode."""

    probability: float  # of each packet at each receiver [1]

    @classmethod
    def of(cls, mission: Mission) -> "Erasure | None":
        """Return the erasures, if any packet is lost."""
        if mission.erasure == 0.0:
            return None
        return cls(title=titled(mission, "erasure"), probability=mission.erasure)

    def change(self, model: ChannelModel) -> ChannelModel:
        """Return a channel that loses this share."""
        return model._replace(reception=model.reception._replace(erasure=self.probability))


@dataclass(frozen=True, kw_only=True, eq=False)
class Bursts(MissionEffect, reads=("burst_begin", "burst_end")):
    """Each receiver is deaf at times, in bursts of slots.

    In each slot a burst begins with the probability `burst_begin`, and ends with the probability
    `burst_end` (Gilbert 1960, Elliott 1963).
    """

    begin: float  # per slot [1]
    end: float  # per slot [1]

    @classmethod
    def of(cls, mission: Mission) -> "Bursts | None":
        """Return the bursts, if any begins."""
        if mission.burst_begin == 0.0:
            return None
        return cls(
            title=titled(mission, "burst_begin", "burst_end"),
            begin=mission.burst_begin,
            end=mission.burst_end,
        )

    def change(self, model: ChannelModel) -> ChannelModel:
        """Return a channel whose receivers are deaf in bursts."""
        reception = model.reception._replace(burst_begin=self.begin, burst_end=self.end)
        return model._replace(reception=reception)


@dataclass(frozen=True, kw_only=True, eq=False)
class HighPower(MissionEffect, reads=("high_power_fraction", "high_power_db")):
    """A fraction of the robots, those of the lowest indices, transmits with more power."""

    num_robots: int  # that do
    extra_db: float

    @classmethod
    def of(cls, mission: Mission) -> "HighPower | None":
        """Return the extra power; a fraction that rounds to no robot has none."""
        if mission.num_high_power == 0:
            return None
        return cls(
            title=titled(mission, "num_high_power", "high_power_db"),
            num_robots=mission.num_high_power,
            extra_db=mission.high_power_db,
        )

    def change(self, model: ChannelModel) -> ChannelModel:
        """Return a channel on which these robots are stronger."""
        at_1_m = model.law.at_1_m.copy()
        at_1_m[: self.num_robots] *= from_db(self.extra_db)
        return model._replace(law=model.law._replace(at_1_m=at_1_m))


@dataclass(frozen=True, kw_only=True, eq=False)
class Clocks(MissionEffect, reads=("clock_offset_s", "clock_drift_ppm")):
    """Each robot's slots begin late, by an offset that is drawn uniformly up to `clock_offset_s`.

    Clocks also drift, by up to `clock_drift_ppm`, either way.
    """

    offset: float  # the greatest [slots]
    drift: float  # the greatest [1]

    @classmethod
    def of(cls, mission: Mission) -> "Clocks | None":
        """Return how clocks differ, if they do."""
        if not mission.clocks_differ:
            return None
        named: list[str] = []
        if mission.clock_offset_s > 0.0:
            named.append("clock_offset_s")
        if mission.clock_drift_ppm > 0.0:
            named.append("clock_drift_ppm")
        return cls(
            title=titled(mission, *named),
            offset=mission.clock_offset_s / mission.slot_s,
            drift=1e-6 * mission.clock_drift_ppm,
        )

    def change(self, model: ChannelModel) -> ChannelModel:
        """Return a channel between robots whose clocks differ."""
        return model._replace(clock_offset=self.offset, clock_drift=self.drift)


@dataclass(frozen=True, kw_only=True, eq=False)
class Obstruction(Effect):
    """Obstacles on the straight line between two robots take power, each its own share.

    They come from the scene, not from numbers of the mission; titles name the arena.
    """

    obstacles: Obstacles

    def change(self, model: ChannelModel) -> ChannelModel:
        """Return a channel between these obstacles."""
        return model._replace(law=model.law._replace(obstacles=self.obstacles))


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyAntennas(Effect):
    """Robots with bodies have antennas above their bases, with gains, and powers of their own.

    They come from the robots' models, not from numbers of the mission.
    """

    antennas: Antennas

    def change(self, model: ChannelModel) -> ChannelModel:
        """Return a channel between these antennas."""
        antennas = self.antennas
        at_1_m = model.law.at_1_m * antennas.power * antennas.gain
        return model._replace(law=model.law._replace(at_1_m=at_1_m, antennas=antennas))


# In the order of the titles. A test finds an effect that is left out.
EFFECTS: tuple[type[MissionEffect], ...] = (
    PathLoss,
    Shadowing,
    Fading,
    Erasure,
    Bursts,
    HighPower,
    Clocks,
)


def effects_of(mission: Mission) -> list[MissionEffect]:
    """Return the effects that a mission's numbers make; none is the paper's free space."""
    effects: list[MissionEffect] = []
    for kind in EFFECTS:
        effect = kind.of(mission)
        if effect is not None:
            effects.append(effect)
    return effects


def beyond_free_space(mission: Mission) -> str:
    """Return the channel's differences from the paper's, in words; empty for free space."""
    return ", ".join(effect.title for effect in effects_of(mission))


def model_of(radio: FreeSpaceRadio, num_robots: int, effects: Iterable[Effect]) -> ChannelModel:
    """Return the numbers of the paper's radio with these effects."""
    reception = Reception(
        noise_mw=radio.noise_mw,
        threshold=radio.threshold,
        recipient_hears_while_sending=radio.recipient_hears_while_sending,
    )
    model = ChannelModel(free_space_law(radio.received_at_1_m_mw, num_robots), reception)
    for effect in effects:
        model = effect.change(model)
    return model
