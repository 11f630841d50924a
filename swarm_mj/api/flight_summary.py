"""The summary of one flight, whose numbers are attributes and keys."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from swarm_mj.simulation.rollout import FlownCosts
from swarm_mj.system.arguments import did_you_mean


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FlightSummary(dict[str, Any], FlownCosts[float, int, float | None, int | None]):
    """The costs of one flight, by the names and in the order of `swarm-mj fly --json`.

    Each number is an attribute. It is a key as well, so `summary["aoi_mean"]`, `dict(summary)` and
    `json.dumps(summary)` do what they do with a dictionary. None is what is not defined.

    Example:
        >>> run.summary.aoi_mean == run.summary["aoi_mean"]
        True
    """

    packet_bytes: int  # of one packet [bytes]
    bytes_per_second: float  # that the team transmitted [bytes/s]
    velocity_variance_left: float | None  # last over first [1]; None if the first is 0
    payload: str  # what packets carry beyond the sender's buffer
    is_centralised: bool  # whether a centre that knows the truth decided
    wall_seconds: float  # that the flight took [s]
    interrupted: bool  # whether it ended before its last window
    strayed: int  # robots that are on and out of everyone's range at the end
    crashed: int | None  # robots with bodies that crashed; None: they are points
    heard_share: float  # pairs of active robots that had heard of each other at the end [1]
    energy_mean_j: float | None  # of a robot [J]; None: points, or models that do not say
    energy_worst_j: float | None  # of the robot that used most [J]; likewise

    def __post_init__(self) -> None:
        """Make each attribute a key."""
        for spec in fields(self):
            self[spec.name] = getattr(self, spec.name)

    def __repr__(self) -> str:
        """Return a line for each name."""
        return as_lines(self)

    if not TYPE_CHECKING:  # to a checker, a name that is not declared is an error

        def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - it only raises
            raise AttributeError(f"there is no {name!r} here{did_you_mean(name, self)}")


class Metrics(dict[str, Any]):
    """A dictionary whose keys are attributes as well."""

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any value
        if name not in self:
            raise AttributeError(f"there is no {name!r} here{did_you_mean(name, self)}")
        return self[name]

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self]

    def __repr__(self) -> str:
        """Return a line for each name; metrics within metrics are indented."""
        return as_lines(self)


def as_lines(numbers: Mapping[str, object]) -> str:
    """Return a line for each name; what takes several lines itself is indented below its name."""
    width = max(map(len, numbers), default=0)
    lines: list[str] = []
    for name, value in numbers.items():
        shown = f"{value:.6g}" if isinstance(value, float) else str(value)
        if isinstance(value, dict):
            lines.append(f"{name}\n  " + shown.replace("\n", "\n  "))
        else:
            lines.append(f"{name:{width}}  {shown}")
    return "\n".join(lines)
