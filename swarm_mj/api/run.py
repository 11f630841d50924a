"""The result of `swarm_mj.fly`: numbers, a table, a chart, files, a video."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from rich.table import Table

from swarm_mj.api.flight_table import flight_rows, flight_title
from swarm_mj.mission import Mission
from swarm_mj.protocol.costs import PACKET_COUNTS
from swarm_mj.replay.recorder import Log
from swarm_mj.replay.view import DEFAULTS, default_seconds, fitted
from swarm_mj.simulation.components import components_in
from swarm_mj.simulation.rollout import WindowRecord
from swarm_mj.system import terminal
from swarm_mj.system.fields import as_typed, did_you_mean
from swarm_mj.system.packages import need
from swarm_mj.system.terminal import is_notebook
from swarm_mj.system.writing import Output, check_outputs, write_bytes, write_csv, write_json

if TYPE_CHECKING:  # each is slow to import, and flights do without
    from matplotlib.figure import Figure
    from pandas import DataFrame

AGE = "age of information: how old a robot's news of another is, over all pairs; less is better"
ELSEWHERE = (
    "run.show() plays a video in a notebook. Here, run.save('flight.mp4') writes the video, and "
    "run.save('flight.rrd') a replay that `swarm-mj replay flight.rrd` opens."
)
PLACES = {  # of a window's numbers in its record, by their columns
    "aoi": "costs.age_windows",
    "velocity_variance": "costs.velocity_variance_m2ps2",
    "task_cost": "costs.task_cost.value",
    "hops": "hops",
    "is_complete": "costs.is_complete",
    **{f"packets_{name}": f"costs.packets.{name}" for name in PACKET_COUNTS},
}


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


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Run:
    """One mission flown; ModuleNotFoundError says which package a table, chart or file lacks.

    `mission` has its numbers; `config` everything that makes this flight again: mission, policy,
    seed, version and commit; `summary` its costs, by the names that `swarm-mj fly --json` uses:
    `summary.aoi_mean` is the age of information [windows]; `windows` the costs of each window;
    `log` the record that a replay shows, and None if nothing was recorded.
    """

    mission: Mission
    config: Mapping[str, Any]
    summary: Metrics
    windows: Sequence[WindowRecord]
    log: Log | None = None

    def __repr__(self) -> str:
        age, window_s = self.summary.aoi_mean, self.mission.window_s
        cost = f"age of information {age:.2f} windows ({age * window_s:.2g} s)"
        return f"<Run {self.title}: {cost} over {len(self.windows)} windows>"

    def _repr_html_(self) -> str:
        """Return the numbers as a table, for notebooks."""
        row = "<tr><th style='text-align:left'>{}</th><td style='text-align:left'>{}</td></tr>"
        rows = (row.format(escape(name), escape(value)) for name, value in self._rows.items())
        return f"<table><caption>{escape(self.title)}</caption>{''.join(rows)}</table>"

    def table(self) -> Table:
        """Return the numbers as a table, for terminals."""
        return terminal.named_values(self.title, self._rows, caption=AGE)

    @property
    def _rows(self) -> dict[str, str]:
        return flight_rows(self.mission, self.summary, self.summary.wall_seconds)

    @property
    def title(self) -> str:
        """Mission, policy, seed and components in a line."""
        title = flight_title(self.mission, self.config["policy"], self.config["seed"])
        return title + components_in(self.config).title

    @property
    def task_cost(self) -> tuple[str, str] | None:
        """The name of the task's cost, such as velocity variance, and its unit; None without."""
        cost = self.windows[0].costs.task_cost
        return None if cost is None else (cost.name, cost.unit)

    def columns(self) -> dict[str, Float[np.ndarray, "T"]]:
        """Return the flight window by window, column by column: all that `to_dataframe` has."""
        window = np.arange(1.0, len(self.windows) + 1.0)
        clock = {"window": window, "seconds": np.round(window * self.mission.window_s, 9)}
        flown = {
            name: np.concatenate([attrgetter(place)(each) for each in self.windows]).astype(float)
            for name, place in PLACES.items()
            if name != "task_cost" or self.task_cost is not None
        }
        worst = {} if self.log is None else {"aoi_worst": self.log.age_max}
        return {**clock, "aoi": flown.pop("aoi"), **worst, **flown}

    def to_dataframe(self) -> "DataFrame":
        """Return one row per window, at its end; what is not defined for the policy is nan.

        The columns are `window` (1 is the first), `seconds`, `aoi` (age of information, mean over
        pairs of robots [windows]), `aoi_worst` (the worst pair's, if the flight was recorded),
        `velocity_variance` [m²/s²], `task_cost` (where the task has one; `summary.task_cost_name`
        names it), `hops` (mean over all known teammates), `is_complete` (every robot knows every
        other) and `packets_...` in that window.
        """
        need("pandas", "a table")
        from pandas import DataFrame

        return DataFrame(self.columns()).astype({"window": int, "is_complete": bool})

    def plot(self) -> "Figure":
        """Draw the age of information over time and, below, the task's cost.

        Of flocks that is the velocity variance. A notebook shows the figure where it is the cell's
        result, `savefig` keeps it, and `matplotlib.pyplot.show()` opens a window.
        """
        need("matplotlib", "a chart")
        from swarm_mj.api.charts import draw_flight

        policy, window_s = self.config["policy"], self.mission.window_s
        return draw_flight(self.columns(), self.title, policy, window_s, self.task_cost)

    def picture(self, window: int | None = None) -> "Figure":
        """Draw a map of one window, for a slide: robots by age, trails, packets, obstacles.

        It is the last window unless given; 1 is the first. Colours are those of the replay. Raises
        ValueError if there is no such window, or nothing was recorded.
        """
        footage = self.footage()
        need("matplotlib", "a picture")
        from swarm_mj.api.picture import draw_picture

        return draw_picture(footage, window)

    def show(self) -> None:
        """Play the flight as a video, in a notebook; elsewhere, say how to see it.

        Raises ValueError if nothing was recorded that a video shows, and OSError if no OpenGL works
        here; it says what to install.
        """
        if not is_notebook():
            self.footage()  # says if there is none
            terminal.plain_console().print(ELSEWHERE)
            return
        content = self._film(".mp4")
        from IPython.display import Video, display

        how = {"embed": True, "mimetype": "video/mp4", "html_attributes": "controls loop"}
        display(Video(data=content, **how))

    def footage(self) -> Log:
        """Return the pictures' data; `rendering.video.make_video` puts two side by side.

        Raises ValueError if nothing was recorded.
        """
        if self.log is None:
            raise ValueError("nothing was recorded that could be shown; fly with record=True")
        return self.log

    def report(self, replay: Path | None = None) -> dict[str, Any]:
        """Return config and summary, as `swarm-mj fly --json` writes them."""
        return {"config": dict(self.config), **self.summary, "replay": replay and str(replay)}

    def save(self, path: str | Path) -> Path:
        """Write the flight, replacing the file if it exists; return the path.

        By its ending, a replay for `swarm-mj replay` (.rrd), a video (.mp4, .gif), the summary as
        `swarm-mj fly --json` writes it (.json), or one row per window (.csv). Raises ValueError if
        the name has another ending, or nothing was recorded that it would show; OSError if the file
        cannot be written, or no OpenGL works here.
        """
        path = Path(path)
        check_outputs(Output("the file", path, ".rrd|.mp4|.gif|.json|.csv"))
        match path.suffix.lower():
            case ".rrd":
                log = self.footage()
                need("rerun", "a replay")
                from swarm_mj.replay.write import write_replay  # rerun is slow to import

                config = {name: value for name, value in self.config.items() if value is not None}
                write_replay(log, config, path)
            case ".json":
                write_json(path, self.report())
            case ".csv":
                columns = self.columns()
                rows = np.column_stack(list(columns.values())).tolist()
                # None, an empty cell, is what is not defined.
                shown = ([None if math.isnan(x) else as_typed(x) for x in row] for row in rows)
                cells = (dict(zip(columns, row, strict=True)) for row in shown)
                write_csv(path, list(columns), cells)
            case ending:
                write_bytes(path, self._film(ending))
        return path

    def _film(self, ending: str) -> bytes:
        """Return the content of a video file, as `swarm-mj replay --video` makes it."""
        footage = self.footage()
        for module in ("av", "PIL"):
            need(module, "a video")
        from swarm_mj.replay.rendering.video import make_video

        style = fitted(replace(DEFAULTS[ending], seconds=default_seconds([footage])), ending)
        console = terminal.quiet_console()
        with terminal.WorkBar("Drawing", style.num_frames, "pictures", console=console) as bar:
            return make_video([footage], ending, style, bar.advance)
