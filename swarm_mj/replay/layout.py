"""The replay's layout: which view shows what, stored in the file as rerun's blueprint."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from swarm_mj.replay import legend, palette
from swarm_mj.replay.arena import square_m
from swarm_mj.replay.charts import (
    RATE_WINDOWS,
    TREE_HEIGHT,
    TREE_WIDTH,
    packet_counts,
    rate,
    shown_cost,
    surprise_shares,
)
from swarm_mj.replay.frame import Frame
from swarm_mj.replay.links import Links
from swarm_mj.replay.recorder import Log
from swarm_mj.replay.sheet import TIMELINE

WINDOWS_PER_SECOND = 30.0  # windows of 100 ms: three times as fast as the mission
# Curves that would dwarf the others; the viewer can show them.
HIDDEN = {"age": "worst", "radio": "overheard"}
MARGIN = 1.06  # of the map, around what it must show


class Layout(rrb.Blueprint):
    """A blueprint that can be closed; rerun would keep the stream that it makes of each."""

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        super()._log_to_stream(stream)

    def close(self) -> None:
        """Lets go of it, once it was sent."""
        self._stream.disconnect()
        del self._stream


def layout(log: Log, frame: Frame, packets: dict[str, Links]) -> Layout:
    """The blueprint of a replay: tabs of the mission, its scene, and the radio of every robot."""
    reach, follows = MARGIN * frame.reach_m, ", follows the team" if frame.moves else ""
    name = f"Map, squares of {square_m(frame):g} m{follows}"
    shown = _drawing("/", name, (-reach, reach), (-reach, reach), contents=["/arena/**"])
    height = legend.height(log)
    samples = _drawing("/legend", "Legend", (0.0, legend.WIDTH), (-3.5, height), titlebar=False)
    charts = _charts(log, packets)
    mission = rrb.Horizontal(
        rrb.Vertical(shown, samples, row_shares=[4, height / legend.TWO_ROWS]),
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
    """Return a part of the plane; the look does not depend on the viewer's theme."""
    bounds = rrb.VisualBounds2D(x_range=x_range, y_range=y_range)
    return rrb.Spatial2DView(
        origin=origin, name=name, background=palette.BACKGROUND, visual_bounds=bounds, **options
    )


def _space(frame: Frame) -> rrb.Spatial3DView:
    """MuJoCo's scene, seen from the south and above."""
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


def _charts(log: Log, packets: dict[str, Links]) -> list[rrb.View | rrb.Container]:
    """Return the ego robot's tree and the ages of all pairs; below them the plots."""
    ego = f"r{log.ego}"
    ages = [log.age_mean + log.age_std, np.mean(log.ego_age, axis=1)]
    radio = f"Packets in {RATE_WINDOWS} windows: " + (
        "sent (grey), heard by anyone (blue)"
        if log.is_broadcast
        else "delivered (green), lost (orange), answered (blue)"
    )
    counts = packet_counts(log, packets)
    rates = [rate(of) for name, (_, of) in counts.items() if name != HIDDEN["radio"]]
    width, height = ((-0.05 * size, 1.05 * size) for size in (TREE_WIDTH, TREE_HEIGHT))
    matrix = rrb.TensorView(
        origin="/ages",
        name="Age of information, all pairs",
        scalar_mapping=rrb.TensorScalarMapping(colormap="Viridis", mag_filter="Nearest"),
        view_fit="Fill",
    )
    charts: list[rrb.View | rrb.Container] = [
        rrb.Horizontal(_drawing("/tree", f"Tree of {ego}, in hops", width, height), matrix),
        _plot("age", f"Age of information [windows]: team ± std (green), {ego} (white)", ages),
        _plot("radio", radio, rates),
    ]
    if log.looks is not None:
        shares = [share for _, share in surprise_shares(log, log.looks).values()]
        name = "believed, too weak (red); works, unbelieved (green); cut off (white)"
        charts.append(_plot("world", f"Share [%]: {name}", shares))
    if (cost := shown_cost(log)) is not None:
        name = f"{cost.name[:1].upper()}{cost.name[1:]} [{cost.unit}]"
        charts.append(_plot("task", name, [cost.value]))
    return charts


def _plot(entity: str, name: str, shown: Sequence[np.ndarray]) -> rrb.TimeSeriesView:
    """Return a plot without a legend, which would cover curves: its name says what they are."""
    hidden: dict[Any, Any] = {}
    if entity in HIDDEN:
        hidden[f"/plots/{entity}/{HIDDEN[entity]}"] = rrb.EntityBehavior(visible=False)
    top = palette.nice_top(max(float(np.max(values)) for values in shown))
    return rrb.TimeSeriesView(
        overrides=hidden,
        axis_y=rrb.ScalarAxis(range=(0.0, 1.06 * top)),  # so that both ends have numbers
        origin=f"/plots/{entity}",
        name=name,
        plot_legend=rrb.PlotLegend(visible=False),
        background=rrb.archetypes.PlotBackground(color=palette.PLOT, show_grid=False),
    )
