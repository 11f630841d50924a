"""The replay's layout: which view shows what, stored in the file as rerun's blueprint."""

from typing import Any

import rerun.blueprint as rrb

from swarm_mj.replay import palette
from swarm_mj.replay.charts import TREE_HEIGHT, TREE_WIDTH
from swarm_mj.replay.sheet import TIMELINE

WINDOWS_PER_SECOND = 30.0  # three times as fast as the mission


def layout(observer: int, reach_m: float, top_age: float, *, has_flock: bool) -> rrb.Blueprint:
    """The blueprint of a replay.

    Args:
        observer: The robot whose knowledge is shown.
        reach_m: Half the width of the map, which is centred on the origin [m].
        top_age: Where the plot of ages ends [windows].
        has_flock: Whether robots move, so that their velocities are worth a plot.

    Returns:
        Two tabs: the mission, and the radio of every robot.
    """
    plots = [_plot("age", "Age of information [windows]", "LeftTop", hidden="worst", top=top_age)]
    if has_flock:
        plots.append(_plot("flock", "Velocity variance [m²/s²]", "RightTop"))
    mission = rrb.Horizontal(
        rrb.Vertical(
            _arena(observer, reach_m),
            _plot("radio", "Packets in the last second", "LeftTop", hidden="overheard"),
            row_shares=[11, 3],
        ),
        rrb.Vertical(
            rrb.Horizontal(_tree(observer), _ages()),
            *plots,
            row_shares=[5] + [3] * len(plots),
        ),
        column_shares=[10, 11],
        name="Mission",
    )
    radio = rrb.Horizontal(
        rrb.StateTimelineView(origin="/state", name="Radio of every robot"),
        rrb.TextDocumentView(origin="/about", name="About this mission"),
        column_shares=[3, 1],
        name="Radio",
    )
    return rrb.Blueprint(
        rrb.Tabs(mission, radio, active_tab=0),
        rrb.TimePanel(
            state="collapsed", timeline=TIMELINE, fps=WINDOWS_PER_SECOND, loop_mode="all"
        ),
        collapse_panels=True,
        auto_views=False,
    )


def _arena(observer: int, reach_m: float) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        origin="/",
        contents=["/arena/**"],
        name=f"Arena · colour: age of what r{observer} knows · rings: where it believes the others",
        background=palette.BACKGROUND,
        # The view's y is down, the map's up.
        visual_bounds=rrb.VisualBounds2D(
            x_range=[-1.04 * reach_m, 1.04 * reach_m], y_range=[-1.03 * reach_m, 1.27 * reach_m]
        ),
    )


def _tree(observer: int) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        origin="/tree",
        name=f"Parent tree of r{observer} · a line is a hop",
        background=palette.BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(
            x_range=[-0.05 * TREE_WIDTH, 1.05 * TREE_WIDTH],
            y_range=[-0.05 * TREE_HEIGHT, 1.05 * TREE_HEIGHT],
        ),
    )


def _ages() -> rrb.TensorView:
    return rrb.TensorView(
        origin="/ages",
        name="Age of what row knows about column",
        scalar_mapping=rrb.TensorScalarMapping(colormap="Viridis", mag_filter="Nearest"),
        view_fit="FillKeepAspectRatio",
    )


def _plot(
    entity: str, name: str, corner: str, hidden: str | None = None, top: float | None = None
) -> rrb.TimeSeriesView:
    overrides: dict[Any, Any] = {}
    if hidden:
        overrides[f"/plots/{entity}/{hidden}"] = rrb.EntityBehavior(visible=False)
    return rrb.TimeSeriesView(
        overrides=overrides,
        axis_y=None if top is None else rrb.ScalarAxis(range=(0.0, top)),
        origin=f"/plots/{entity}",
        name=name,
        plot_legend=rrb.PlotLegend(rrb.Corner2D.auto(corner)),
        background=rrb.archetypes.PlotBackground(color=palette.BACKGROUND, show_grid=True),
    )
