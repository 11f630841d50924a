"""An effect of a channel: whether a mission has it, how a title names it, and what it changes.

`effects` has them all.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from swarm_mj.mission import Mission
from swarm_mj.radio.power_law import PowerLaw
from swarm_mj.radio.reception import Reception
from swarm_mj.system.fields import as_typed


class ChannelModel(NamedTuple):
    """The numbers of a channel: of mean powers, of reception, and of what is drawn once."""

    law: PowerLaw  # of mean powers without shadowing [mW]
    reception: Reception
    shadowing_db: float = 0.0  # standard deviation; 0 is none [dB]
    shadowing_distance_m: float = 1.0  # over which its correlation falls to 1/e [m]
    clock_offset: float = 0.0  # the greatest, between robots [slots]
    clock_drift: float = 0.0  # the greatest, either way [1]


@dataclass(frozen=True, kw_only=True, eq=False)
class Effect(ABC):
    """Something that a channel has and free space has not."""

    @abstractmethod
    def change(self, model: ChannelModel) -> ChannelModel:
        """Return the numbers of a channel that has this effect, too."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MissionEffect(Effect):
    """An effect that numbers of the mission make.

    A class names the fields of `Mission` that it `reads`, as no other does; its docstring is its
    row in the documentation.
    """

    reads: ClassVar[tuple[str, ...]]
    title: str  # the fields that count, and their values

    def __init_subclass__(cls, *, reads: tuple[str, ...]) -> None:
        """Take the fields of `Mission` that this effect and no other reads."""
        super().__init_subclass__()
        cls.reads = reads

    @classmethod
    @abstractmethod
    def of(cls, mission: Mission) -> "MissionEffect | None":
        """Return the effect that a mission has, or None."""


def titled(mission: Mission, *names: str) -> str:
    """Return fields of a mission with their values, as a title has them."""
    return ", ".join(f"{name} {as_typed(getattr(mission, name))}" for name in names)
