"""The replay's layout: which view shows what, stored in the file as rerun's blueprint."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from swarm_mj.replay import legend, palette
from swarm_mj.replay.arena import square_m
from swarm_mj.replay.charts import TREE_HEIGHT, TREE_WIDTH, Plot
from swarm_mj.replay.footage import Ground
from swarm_mj.replay.recorder import Log
from swarm_mj.replay.rerun_log import TIMELINE

WINDOWS_PER_SECOND = 30.0  # windows of 100 ms: three times as fast as the mission
MARGIN = 1.06  # of the map, around what it must show


class Layout(rrb.Blueprint):
    """A blueprint that can be closed; rerun would keep the stream that it makes of each."""

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        super()._log_to_stream(stream)

    def close(self) -> None:
        """Release the stream, once it was sent."""
        self._stream.disconnect()
        del self._stream


def layout(log: Log, frame: Ground, shown: Sequence[Plot]) -> Layout:
    """Return the blueprint: tabs of the mission, its scene, and the radio of every robot."""
    reach, follows = MARGIN * frame.reach_m, ", follows the team" if frame.moves else ""
    name = f"Map, squares of {square_m(frame):g} m{follows}"
    ground = _drawing("/", name, (-reach, reach), (-reach, reach), contents=["/arena/**"])
    height = legend.height(log)
    samples = _drawing("/legend", "Legend", (0.0, legend.WIDTH), (-3.5, height), titlebar=False)
    charts = [_tree_and_ages(log), *map(_plot, shown)]
    mission = rrb.Horizontal(
        rrb.Vertical(ground, samples, row_shares=[4, height / legend.TWO_ROWS]),
        rrb.Vertical(*charts, row_shares=[4, *[3] * (len(charts) - 1)]),
        column_shares=[11, 10],
        name="Mission",
    )
    radio = rrb.Horizontal(
        rrb.StateTimelineView(origin="/state", name="Radio of every robot"),
        rrb.TextDocumentView(origin="/about", name="About this mission"),
        column_shares=[3, 1],
        name="Radio",
    )
    return Layout(
        rrb.Tabs(mission, _space(frame), radio, active_tab=0),
        rrb.TimePanel(
            state="collapsed", timeline=TIMELINE, fps=WINDOWS_PER_SECOND, loop_mode="all"
        ),
        collapse_panels=True,
        auto_views=False,
    )


def _drawing(
    origin: str,
    name: str,
    x_range: tuple[float, float],
    y_range: tuple[float, float],
    **options: Any,
) -> rrb.Spatial2DView:
    # The background is set so that colours do not depend on the viewer's theme.
    bounds = rrb.VisualBounds2D(x_range=x_range, y_range=y_range)
    return rrb.Spatial2DView(
        origin=origin, name=name, background=palette.BACKGROUND, visual_bounds=bounds, **options
    )


def _space(frame: Ground) -> rrb.Spatial3DView:
    reach = frame.reach_m
    eye = rrb.EyeControls3D(
        position=(0.0, -1.35 * reach, 1.75 * reach),
        look_target=(0.0, -0.12 * reach, 0.0),
        eye_up=(0.0, 0.0, 1.0),
    )
    return rrb.Spatial3DView(
        origin="/",
        contents=["/scene/**"],
        name="Scene in 3-D, colours as on the map",
        background=palette.BACKGROUND,
        line_grid=False,
        eye_controls=eye,
    )


def _tree_and_ages(log: Log) -> rrb.Horizontal:
    """Return the ego robot's tree next to the ages of all pairs."""
    width, height = ((-0.05 * size, 1.05 * size) for size in (TREE_WIDTH, TREE_HEIGHT))
    matrix = rrb.TensorView(
        origin="/ages",
        name="Age of information, all pairs",
        scalar_mapping=rrb.TensorScalarMapping(colormap="Viridis", mag_filter="Nearest"),
        view_fit="Fill",
    )
    return rrb.Horizontal(_drawing("/tree", f"Tree of r{log.ego}, in hops", width, height), matrix)


def _plot(plot: Plot) -> rrb.TimeSeriesView:
    hidden: dict[Any, Any] = {
        f"/plots/{curve.path}": rrb.EntityBehavior(visible=False)
        for curve in plot.curves
        if curve.is_hidden
    }
    top = palette.nice_top(
        max(
            float(np.max(curve.values if curve.std is None else curve.values + curve.std))
            for curve in plot.curves
            if not curve.is_hidden
        )
    )
    return rrb.TimeSeriesView(
        overrides=hidden,
        axis_y=rrb.ScalarAxis(range=(0.0, 1.06 * top)),  # so that both ends have numbers
        origin=f"/plots/{plot.curves[0].path.split('/')[0]}",
        name=plot.name,
        plot_legend=rrb.PlotLegend(visible=False),  # it would cover curves; the name says the same
        background=rrb.archetypes.PlotBackground(color=palette.PLOT, show_grid=False),
    )
