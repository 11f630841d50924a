"""What `swarm_mj.fly` gives back: numbers, a table, a chart, files, a video."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from swarm_mj.api.bars import is_notebook
from swarm_mj.api.flight_table import flight_rows, flight_title
from swarm_mj.api.numbers import Numbers
from swarm_mj.mission import Mission
from swarm_mj.mission.components import components_in
from swarm_mj.protocol.costs import PACKETS
from swarm_mj.replay.recorder import Log
from swarm_mj.simulation.rollout import WindowRecord
from swarm_mj.system.atomic import write_bytes, write_csv, write_json
from swarm_mj.system.fields import as_typed
from swarm_mj.system.outputs import Output, check_outputs
from swarm_mj.system.packages import need

if TYPE_CHECKING:  # each takes its time to import, and flights do without
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from swarm_mj.replay.footage import Footage


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Run:
    """One mission flown.

    Attributes:
        mission: Its numbers.
        config: Everything that makes this flight again: mission, policy, seed, version and commit.
        summary: What it cost, by the names that `swarm-mj fly --json` uses: `summary.aoi_mean` is
            the age of information [windows].
        windows: What each window cost.
        log: What a replay shows; None if nothing was recorded.
    """

    mission: Mission
    config: Mapping[str, Any]
    summary: Numbers
    windows: Sequence[WindowRecord]
    log: Log | None

    def __repr__(self) -> str:
        age, window_s = self.summary.aoi_mean, self.mission.window_s
        return (
            f"<Run {self.title}: age of information {age:.2f} windows ({age * window_s:.2g} s) "
            f"over {len(self.windows)} windows>"
        )

    def _repr_html_(self) -> str:
        """Return the numbers as a table, for notebooks."""
        rows = flight_rows(self.mission, self.summary, self.summary.wall_seconds)
        lines = "".join(
            f"<tr><th style='text-align:left'>{escape(name)}</th>"
            f"<td style='text-align:left'>{escape(value)}</td></tr>"
            for name, value in rows.items()
        )
        return f"<table><caption>{escape(self.title)}</caption>{lines}</table>"

    @property
    def title(self) -> str:
        """What was flown, in a line."""
        title = flight_title(self.mission, self.config["policy"], self.config["seed"])
        return title + components_in(self.config).title

    @property
    def task_cost(self) -> tuple[str, str] | None:
        """What the robots' task costs, such as a formation error, and its unit; None if nothing."""
        cost = self.windows[0].costs.task_cost
        return None if cost is None else (cost.name, cost.unit)

    def columns(self) -> dict[str, Float[np.ndarray, "T"]]:
        """Return the flight window by window, column by column: all that `to_dataframe` has."""
        window = np.arange(1.0, len(self.windows) + 1.0)
        worst = {"aoi_worst": self.log.age_max} if self.log else {}
        task = {} if self.task_cost is None else {"task_cost": self._course(_task_cost)}
        packets = {
            f"packets_{name}": self._course(
                lambda each, name=name: getattr(each.costs.packets, name)
            )
            for name in PACKETS
        }
        return {
            "window": window,
            "seconds": np.round(window * self.mission.window_s, 9),
            "aoi": self._course(lambda each: each.costs.age_windows),
            **worst,
            "velocity_variance": self._course(lambda each: each.costs.velocity_variance_m2ps2),
            **task,
            "hops": self._course(lambda each: each.hops),
            "is_complete": self._course(lambda each: each.costs.is_complete),
            **packets,
        }

    def to_dataframe(self) -> "DataFrame":
        """One row per window, at its end; what does not apply to the policy's packets is nan.

        Returns:
            A pandas table with the columns `window` (1 is the first), `seconds`, `aoi` (age of
            information, mean over pairs of robots [windows]), `aoi_worst` (the worst pair's, if the
            flight was recorded), `velocity_variance` [m²/s²], `task_cost` (where the task has one;
            `summary.task_cost_name` says which), `hops` (mean over the news known), `is_complete`
            (everyone has heard of everyone) and `packets_...` in that window.

        Raises:
            ModuleNotFoundError: pandas is not installed.
        """
        need("pandas", "a table")
        from pandas import DataFrame

        whole = {"window": int, "is_complete": bool}
        return DataFrame(self.columns()).astype(whole)

    def plot(self) -> "Figure":
        """Draws the age of information over time and, below, what the task costs.

        Of flocks and random walks that is the velocity variance.

        Returns:
            A matplotlib figure; a notebook shows it where it is the cell's result, `savefig` keeps
            it, and `matplotlib.pyplot.show()` opens it in a window.

        Raises:
            ModuleNotFoundError: matplotlib is not installed.
        """
        need("matplotlib", "a chart")
        from swarm_mj.api.charts import draw_run

        return draw_run(self)

    def show(self) -> None:
        """Plays the flight as a video, in a notebook; elsewhere, says how to see it.

        Raises:
            ValueError: Nothing was recorded that a video shows.
            OSError: No OpenGL works here; it says what to install.
            ModuleNotFoundError: A package that makes videos is not installed.
        """
        from swarm_mj.api import video

        if is_notebook():
            video.play(video.film(self.footage(), ".mp4"))
        else:
            video.tell_where()

    def footage(self) -> "Footage":
        """What a video shows of the flight; `rendering.video.make_video` puts two side by side.

        Raises:
            ValueError: Nothing was recorded.
        """
        from swarm_mj.replay.footage import footage_of

        policy, seed = self.config["policy"], self.config["seed"]
        components = components_in(self.config)
        return footage_of(self._recorded(), self.mission, policy, seed, components)

    def save(self, path: str | Path) -> Path:
        """Write the flight, replacing the file if it exists.

        Args:
            path: By its ending, a replay for `swarm-mj replay` (.rrd), a video (.mp4, .gif), the
                summary as `swarm-mj fly --json` writes it (.json), or one row per window (.csv).

        Returns:
            The path.

        Raises:
            ValueError: The name has another ending, or nothing was recorded that it would show.
            OSError: The file cannot be written, or no OpenGL works here.
            ModuleNotFoundError: A package that writes such files is not installed.
        """
        path = Path(path)
        check_outputs(Output("the file", path, "|".join(WRITERS)))
        WRITERS[path.suffix.lower()](self, path)
        return path

    def _recorded(self) -> Log:
        if self.log is None:
            raise ValueError("nothing was recorded that could be shown; fly with record=True")
        return self.log

    def _course(
        self, of: Callable[[WindowRecord], Float[np.ndarray, "B"]]
    ) -> Float[np.ndarray, "T"]:
        """Return a cost of the mission, window by window."""
        return np.array([float(of(window)[0]) for window in self.windows])


def _task_cost(window: WindowRecord) -> Float[np.ndarray, "B"]:
    cost = window.costs.task_cost
    return np.array([np.nan]) if cost is None else cost.value


def _write_replay(run: Run, path: Path) -> None:
    log = run._recorded()
    need("rerun", "a replay")
    from swarm_mj.replay.write import write_replay  # rerun takes its time to import

    config = {name: value for name, value in run.config.items() if value is not None}
    write_replay(log, run.mission, config, path)


def _write_video(run: Run, path: Path) -> None:
    from swarm_mj.api.video import film

    write_bytes(path, film(run.footage(), path.suffix.lower()))


def _write_summary(run: Run, path: Path) -> None:
    write_json(path, {"config": dict(run.config)} | dict(run.summary) | {"replay": None})


def _write_windows(run: Run, path: Path) -> None:
    columns = run.columns()
    rows = np.stack(list(columns.values()), axis=1).tolist()
    texts = ([None if math.isnan(value) else as_typed(value) for value in row] for row in rows)
    write_csv(path, list(columns), (dict(zip(columns, row, strict=True)) for row in texts))


WRITERS = {
    ".rrd": _write_replay,
    ".mp4": _write_video,
    ".gif": _write_video,
    ".json": _write_summary,
    ".csv": _write_windows,
}
