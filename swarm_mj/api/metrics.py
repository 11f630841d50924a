"""Metrics by name: `metrics.aoi_mean`, `metrics["aoi_mean"]`, and a table of all when shown."""

from collections.abc import Iterator, Mapping
from typing import Any

from swarm_mj.system.fields import did_you_mean


class Metrics(Mapping[str, Any]):
    """A mapping that cannot be changed, whose keys are attributes as well."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        """Take the values by their names."""
        self._values = dict(values)

    def __getitem__(self, name: str) -> Any:  # noqa: ANN401 - any value
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any value
        # Unpickling asks for attributes before there are values.
        values = self.__dict__.get("_values", {})
        if name not in values:
            raise AttributeError(f"there is no {name!r} here{did_you_mean(name, values)}")
        return values[name]

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._values]

    def __repr__(self) -> str:
        """Return a line for each name; metrics within metrics are indented."""
        width = max((len(name) for name in self), default=0)
        lines = []
        for name, value in self.items():
            shown = f"{value:.6g}" if isinstance(value, float) else str(value)
            nested = f"{name}\n  " + shown.replace("\n", "\n  ")
            lines.append(nested if isinstance(value, Metrics) else f"{name:{width}}  {shown}")
        return "\n".join(lines)
