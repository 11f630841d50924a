"""The result of `swarm_mj.fly`: numbers, a table, a chart, files, a video."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from rich.table import Table

from swarm_mj.api.flight_columns import flight_columns
from swarm_mj.api.flight_summary import FlightSummary
from swarm_mj.api.flight_table import flight_rows, flight_title
from swarm_mj.mission import Mission
from swarm_mj.protocol.costs import CostName
from swarm_mj.protocol.mission_costs import AOI
from swarm_mj.replay.log import Log
from swarm_mj.replay.view import DEFAULTS, default_seconds, fitted
from swarm_mj.simulation.components import components_in
from swarm_mj.simulation.rollout import WindowRecord
from swarm_mj.system import terminal
from swarm_mj.system.fields import as_typed
from swarm_mj.system.packages import need
from swarm_mj.system.terminal import is_notebook
from swarm_mj.system.writing import Output, check_outputs, write_bytes, write_csv, write_json

if TYPE_CHECKING:  # each is slow to import, and flights do without
    from matplotlib.figure import Figure
    from pandas import DataFrame

AGE = f"{AOI.title}: how old a robot's news of another is, over all pairs; less is better"
ELSEWHERE = (
    "run.show() plays a video in a notebook. Here, run.save('flight.mp4') writes the video, and "
    "run.save('flight.rrd') a replay that `swarm-mj replay flight.rrd` opens."
)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Run:
    """One mission flown: what `swarm_mj.fly` returns.

    A table, chart or file that needs a package which is not installed raises ModuleNotFoundError
    that names it.

    Attributes:
        mission: The mission's numbers.
        config: Everything that makes this flight again: mission, policy, seed, version, commit.
        summary: The flight's costs by the names that `swarm-mj fly --json` uses:
            `summary.aoi_mean` is the age of information [windows].
        windows: The costs of each window.
        log: The record that a replay shows; None if nothing was recorded.

    Example:
        ```python
        run = swarm_mj.fly("flocking", policy="planner", seed=1)
        print(run.summary.aoi_mean)
        run.plot().savefig("age.png")
        run.save("flight.rrd")
        ```
    """

    mission: Mission
    config: Mapping[str, Any]
    summary: FlightSummary
    windows: Sequence[WindowRecord]
    log: Log | None = None

    def __repr__(self) -> str:
        age = self.summary.aoi_mean
        age_s = age * self.mission.window_s
        cost = f"{AOI.title} {age:.{AOI.digits}f} {AOI.unit} ({age_s:.2g} s)"
        return f"<Run {self.title}: {cost} over {len(self.windows)} windows>"

    def _repr_html_(self) -> str:
        """Return the numbers as a table, for notebooks."""
        row = "<tr><th style='text-align:left'>{}</th><td style='text-align:left'>{}</td></tr>"
        rows = (row.format(escape(name), escape(value)) for name, value in self._rows.items())
        return f"<table><caption>{escape(self.title)}</caption>{''.join(rows)}</table>"

    def table(self) -> Table:
        """Return the numbers as a table, for terminals.

        Returns:
            A table of rich's, a name and a value per row, with the flight's title above it.

        Example:
            >>> rich.print(run.table())
        """
        return terminal.named_values(self.title, self._rows, caption=AGE)

    @property
    def _rows(self) -> dict[str, str]:
        return flight_rows(self.mission, self.summary)

    @property
    def title(self) -> str:
        """Mission, policy, seed and components in a line."""
        title = flight_title(self.mission, self.config["policy"], self.config["seed"])
        return title + components_in(self.config).title

    @property
    def task_cost(self) -> CostName | None:
        """The name of the task's cost, such as velocity variance, and its unit; None without."""
        cost = self.windows[0].costs.task_cost
        return None if cost is None else CostName(cost.name, cost.unit)

    def columns(self) -> dict[str, Float[np.ndarray, "T"]]:
        """Return the flight window by window, column by column.

        Returns:
            The columns of `to_dataframe`, in its order, each with a number for each window.
        """
        return flight_columns(self.mission, self.windows, self.log)

    def to_dataframe(self) -> "DataFrame":
        """Return one row per window, at its end.

        Returns:
            A table with the columns `window` (1 is the first), `seconds`, `aoi` (age of
            information, mean over pairs of robots [windows]), `aoi_worst` (the worst pair's, if
            the flight was recorded), `velocity_variance` [m²/s²], `task_cost` (where the task has
            one; `summary.task_cost_name` names it), `hops` (mean over all known teammates),
            `is_complete` (every robot knows every other) and `packets_...` in that window. What is
            not defined for the policy is nan.

        Raises:
            ModuleNotFoundError: pandas is not installed.
        """
        need("pandas", "a table")
        from pandas import DataFrame

        return DataFrame(self.columns()).astype({"window": int, "is_complete": bool})

    def plot(self) -> "Figure":
        """Draw the age of information over time and, below, the task's cost.

        Of flocks that is the velocity variance, with the window from which on they had agreed.

        Returns:
            A figure of matplotlib's. A notebook shows it where it is the cell's result, `savefig`
            keeps it, and `matplotlib.pyplot.show()` opens a window.

        Raises:
            ModuleNotFoundError: matplotlib is not installed.

        Example:
            ```python
            swarm_mj.fly("flocking").plot().savefig("age.png")
            ```
        """
        need("matplotlib", "a chart")
        from swarm_mj.api.charts import draw_flight

        return draw_flight(
            columns=self.columns(),
            title=self.title,
            policy=self.config["policy"],
            window_s=self.mission.window_s,
            own_cost=self.task_cost,
            agreed_window=self.summary.agreed_window,
        )

    def picture(self, window: int | None = None) -> "Figure":
        """Draw a map of one window, for a slide: robots by age, trails, packets, obstacles.

        Args:
            window: The window's number, 1 for the first; None is the last.

        Returns:
            A figure of matplotlib's, 16 by 9, in the replay's colours.

        Raises:
            ValueError: There is no such window, or nothing was recorded.
            ModuleNotFoundError: matplotlib is not installed.

        Example:
            ```python
            swarm_mj.fly("flocking", num_robots=20).picture(100).savefig("flock.png")
            ```
        """
        footage = self.footage()
        need("matplotlib", "a picture")
        from swarm_mj.api.picture import draw_picture

        return draw_picture(footage, window)

    def show(self) -> None:
        """Play the flight as a video, in a notebook; elsewhere, say how to see it.

        Raises:
            ValueError: Nothing was recorded that a video shows.
            OSError: No OpenGL works here; the message says what to install.
            ModuleNotFoundError: A package that makes videos is not installed.
        """
        if not is_notebook():
            self.footage()  # says if there is none
            terminal.plain_console().print(ELSEWHERE)
            return
        content = self._film(".mp4")
        from IPython.display import Video, display

        video = Video(
            data=content, embed=True, mimetype="video/mp4", html_attributes="controls loop"
        )
        display(video)

    def footage(self) -> Log:
        """Return what pictures and videos show.

        Returns:
            The log. `swarm_mj.replay.rendering.video.make_video` makes a video of one or of two
            side by side.

        Raises:
            ValueError: Nothing was recorded.
        """
        if self.log is None:
            raise ValueError("nothing was recorded that could be shown; fly with record=True")
        return self.log

    def report(self, replay: Path | None = None) -> dict[str, Any]:
        """Return config and summary, as `swarm-mj fly --json` writes them.

        Args:
            replay: Where the flight's replay was written, if it was.

        Returns:
            `config`, the summary's numbers by their names, and `replay`, a path or None.

        Example:
            >>> run.report()["aoi_mean"] == run.summary.aoi_mean
            True
        """
        shown = None if replay is None else str(replay)
        return {"config": dict(self.config), **self.summary, "replay": shown}

    def save(self, path: str | Path) -> Path:
        """Write the flight to a file, which is replaced if it exists.

        Args:
            path: By its ending, a replay for `swarm-mj replay` (.rrd), a video (.mp4, .gif), the
                summary as `swarm-mj fly --json` writes it (.json), or one row per window (.csv).

        Returns:
            The path.

        Raises:
            ValueError: The name has another ending, or nothing was recorded that it would show.
            OSError: The file cannot be written, or no OpenGL works here.
            ModuleNotFoundError: A package that writes such a file is not installed.

        Example:
            ```python
            run.save("flight.rrd")  # `swarm-mj replay flight.rrd` opens it
            run.save("windows.csv")
            ```
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
                write_csv(path, list(self.columns()), self._cells())
            case ending:
                write_bytes(path, self._film(ending))
        return path

    def _cells(self) -> Iterator[dict[str, Any]]:
        """Return the rows of a table of windows; None, an empty cell, is what is not defined."""
        columns = self.columns()
        for row in np.column_stack(list(columns.values())).tolist():
            shown = [None if math.isnan(number) else as_typed(number) for number in row]
            yield dict(zip(columns, shown, strict=True))

    def _film(self, ending: str) -> bytes:
        """Return the content of a video file, as `swarm-mj replay --video` makes it."""
        footage = self.footage()
        for module in ("av", "PIL"):
            need(module, "a video")
        from swarm_mj.replay.rendering.video import make_video

        style = replace(DEFAULTS[ending], seconds=default_seconds([footage]))
        style = fitted(style, ending)
        console = terminal.quiet_console()
        with terminal.WorkBar("Drawing", style.num_frames, "pictures", console=console) as bar:
            return make_video([footage], ending, style, bar.advance)
