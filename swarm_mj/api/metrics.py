"""Metrics by name: `metrics.aoi_mean`, `metrics["aoi_mean"]`, and a table of all when shown."""

from typing import Any

from swarm_mj.system.fields import did_you_mean


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
        width = max(map(len, self), default=0)
        lines = []
        for name, value in self.items():
            shown = f"{value:.6g}" if isinstance(value, float) else str(value)
            nested = f"{name}\n  " + shown.replace("\n", "\n  ")
            lines.append(nested if isinstance(value, Metrics) else f"{name:{width}}  {shown}")
        return "\n".join(lines)
