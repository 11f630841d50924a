"""The replay's layout, stored as rerun's blueprint, and the map's legend: rerun has none."""

import itertools
import re
from collections.abc import Iterable
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.encodings import EntityPathLike

from swarm_mj.replay import layers, palette
from swarm_mj.replay.charts import STATES_SIZE, TREE_SIZE
from swarm_mj.replay.layer_kinds import Arrows, Lines, Lines3D, Points, Rings, of_others
from swarm_mj.replay.layers import LegendSample, legend
from swarm_mj.replay.log import Log
from swarm_mj.replay.plots import Plot, plots
from swarm_mj.replay.replay_size import in_matrix
from swarm_mj.replay.rerun_log import TIMELINE, RerunLog
from swarm_mj.replay.stage import square_m
from swarm_mj.replay.training_curve import X_RANGE, Y_RANGE, TrainingCurve

WINDOWS_PER_SECOND = 30.0  # windows of 100 ms: three times as fast as the mission
SCENE = "Scene in 3-D, colours as on the map"
MARGIN = 1.06  # of the map, around what it must show

WIDTH = 100.0  # of the legend's view, in units of its own, y down
LEFT = 4.0  # where the ramp of ages begins
RAMP = 31.0  # how long it is
COLUMN = 14.2  # from one sample to the next, to the right of the ramp
ROW = 8.4  # from one row of samples to the next
SAMPLE = 5.0  # the length of a sample
MOST_ROWS = 3  # of samples, which a flight that goes on may come to need
LAST = 5.1  # the height of the last row, with its texts
LINE = 1.9  # of a text's second line, which they have beyond free space only
BELOW = 2.6  # from a sample to its text
NUM_SHADES = 60

Range: TypeAlias = tuple[float, float]
Overrides: TypeAlias = dict[EntityPathLike, rrb.EntityBehavior]  # of what a view shows


class Layout(rrb.Blueprint):
    """A blueprint that can be closed; rerun would keep the stream and two threads of each."""

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        super()._log_to_stream(stream)

    def close(self) -> None:
        """Release the stream, once it was sent."""
        self._stream.disconnect()
        del self._stream


def layout(
    out: RerunLog,
    *,
    is_live: bool = False,
    live_fps: float | None = None,
    curve: TrainingCurve | None = None,
) -> Layout:
    """Return the blueprint: tabs of the mission, its scene, and the radio of every robot.

    Args:
        out: What was drawn.
        is_live: Whether more will be drawn: the plots' axes grow with it, and the viewer shows what
            came last.
        live_fps: Windows a second that the viewer plays of such a flight instead.
        curve: Of a training: a tab more, in front, has it beside the mission, which the viewer
            plays again and again.
    """
    mission = rrb.Horizontal(
        _left(out, is_live=is_live),
        _right(out, is_live=is_live),
        column_shares=[11, 10],
        name="Mission",
    )
    shown = [mission, _scene(out, SCENE), _radio(out.log)]
    if curve is not None:
        shown.insert(0, _training(out, curve, is_live=is_live))
    tabs = rrb.Tabs(*shown, active_tab=0)
    panel = rrb.TimePanel(
        state="collapsed",
        timeline=TIMELINE,
        fps=WINDOWS_PER_SECOND,
        play_state=None if curve is None else "playing",
        loop_mode="all",
    )
    if is_live and curve is None:
        panel = rrb.TimePanel(
            state="collapsed",
            timeline=TIMELINE,
            fps=live_fps or WINDOWS_PER_SECOND,
            play_state="playing" if live_fps else "following",
            loop_mode="off",
        )
    return Layout(tabs, panel, collapse_panels=True, auto_views=False)


def _left(out: RerunLog, *, is_live: bool) -> rrb.Vertical:
    """Return the map above its legend."""
    ground = out.drawn.ground
    across = (-MARGIN * ground.reach_m, MARGIN * ground.reach_m)
    name = f"Map, squares of {square_m(ground):g} m"
    if ground.moves:
        name += ", follows the team"
    map_view = _drawing(
        "/", name, across, across, contents=layers.ARENA.contents, hidden=layers.LINKS.values()
    )
    return _above_legend(out, map_view, is_live=is_live)


def _above_legend(
    out: RerunLog, view: rrb.Spatial2DView | rrb.Spatial3DView, *, is_live: bool
) -> rrb.Vertical:
    """Return a view above the map's legend."""
    num_rows = MOST_ROWS if is_live and out.log.is_compared else len(legend_rows(out))
    height = legend_height(out.log, num_rows)
    samples = _drawing(
        f"/{layers.LEGEND.path}", "Legend", (0.0, WIDTH), (-3.5, height), titlebar=False
    )
    return rrb.Vertical(view, samples, row_shares=[4, height / (ROW + LAST)])


def _training(out: RerunLog, curve: TrainingCurve, *, is_live: bool) -> rrb.Horizontal:
    """Return the mission in 3-D beside the learning curve, and the mission's ages below that."""
    learned = _drawing(
        f"/{layers.LEARNING.path}",
        f"Learning curve: {curve.title} of held-out missions, over team decisions",
        X_RANGE,
        Y_RANGE,
    )
    age, *_ = plots(out.log)
    scene = _scene(out, "First held-out mission, as the newest policy flies it")
    return rrb.Horizontal(
        _above_legend(out, scene, is_live=is_live),
        rrb.Vertical(learned, _plot(age, None), row_shares=[5, 3]),
        column_shares=[1, 1],
        name="Training",
    )


def _right(out: RerunLog, *, is_live: bool) -> rrb.Vertical:
    """Return the tree and the age matrix above the charts."""
    log = out.log
    width, height = TREE_SIZE
    across = (-0.05 * width, 1.05 * width)
    up = (-0.05 * height, 1.05 * height)
    name = f"Tree of r{log.ego}, in hops"
    tree = _drawing("/", name, across, up, contents=layers.TREE.contents)
    name = "Age of row's knowledge of column"
    every = in_matrix(log.facts.mission.num_robots).step
    if every > 1:
        name += f", every {every}th robot"
    matrix = _drawing("/", name, (0.0, width), (0.0, height), contents=f"/{layers.AGES.path}")
    tops = {} if is_live else out.drawn.tops
    charts = [_plot(plot, tops.get(plot.view.path)) for plot in plots(log)]
    shares = [4] + [3] * len(charts)
    return rrb.Vertical(rrb.Horizontal(tree, matrix), *charts, row_shares=shares)


def _radio(log: Log) -> rrb.Horizontal:
    """Return the states of every robot's radio, beside what is written about the mission."""
    states = "delivers (green), is lost (orange), answers (blue), overhears (pink)"
    if log.facts.is_broadcast:
        states = "transmits (blue), hears (dark)"
    width, height = STATES_SIZE
    across = (-0.07 * width, 1.02 * width)
    up = (-0.07 * height, 1.02 * height)
    name = f"Radio of every robot: {states}"
    return rrb.Horizontal(
        _drawing("/", name, across, up, contents=layers.STATES.contents),
        rrb.TextDocumentView(origin=f"/{layers.ABOUT.path}", name="About this mission"),
        column_shares=[3, 1],
        name="Radio",
    )


def _without_others(links: Iterable[Lines | Lines3D]) -> Overrides:
    """Hide the links between others than the observer; the viewer can show them."""
    hidden: Overrides = {}
    for layer in links:
        hidden[f"/{of_others(layer).path}"] = rrb.EntityBehavior(visible=False)
    return hidden


def _scene(out: RerunLog, name: str) -> rrb.Spatial3DView:
    reach_m = out.drawn.ground.reach_m
    return rrb.Spatial3DView(
        origin="/",
        contents=[layers.SCENE.contents],
        overrides=_without_others(layers.SCENE_LINKS.values()),
        name=name,
        background=palette.BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(0.0, -1.35 * reach_m, 1.75 * reach_m),
            look_target=(0.0, -0.12 * reach_m, 0.0),
            eye_up=(0.0, 0.0, 1.0),
        ),
    )


def _drawing(
    origin: str,
    name: str,
    x_range: Range,
    y_range: Range,
    *,
    contents: str = "$origin/**",
    hidden: Iterable[Lines] = (),
    titlebar: bool | None = None,
) -> rrb.Spatial2DView:
    """Return a view in 2-D; without `contents`, of all that is below its origin."""
    # The background is set so that colours do not depend on the viewer's theme.
    return rrb.Spatial2DView(
        origin=origin,
        name=name,
        contents=contents,
        titlebar=titlebar,
        overrides=_without_others(hidden),
        background=palette.BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=x_range, y_range=y_range),
    )


def _plot(plot: Plot, highest: float | None) -> rrb.TimeSeriesView:
    """Return a plot's view, up to the highest value of its curves; None is not known yet."""
    hidden: Overrides = {}
    for curve in plot.curves:
        if curve.is_hidden:
            hidden[f"/{curve.entity.path}"] = rrb.EntityBehavior(visible=False)
    axis = None
    if highest is not None:  # so that both ends have numbers
        axis = rrb.ScalarAxis(range=(0.0, 1.06 * palette.nice_top(highest)))
    return rrb.TimeSeriesView(
        overrides=hidden,
        axis_y=axis,
        origin=f"/{plot.view.path}",
        name=plot.title,
        plot_legend=rrb.PlotLegend(visible=False),  # it would cover curves; the name says the same
        background=rrb.archetypes.PlotBackground(color=palette.PLOT, show_grid=False),
    )


def draw_legend(out: RerunLog) -> None:
    """Draw the ramp of ages, and samples of what the map shows."""
    _draw_ramp(out)
    for row, samples in enumerate(legend_rows(out)):
        y = row * _row_height(out.log)
        for column, sample in enumerate(samples):
            x = LEFT + RAMP + (column + 0.9) * COLUMN
            entity = layers.LEGEND.below(re.sub(r"\W", "_", sample.text))
            out.fixed(entity, _sample(sample, x, y))
            out.words(entity.below("text"), [sample.text], [(x, y + BELOW)])


def _draw_ramp(out: RerunLog) -> None:
    full_scale = out.log.facts.full_scale
    edges = LEFT + np.linspace(0.0, RAMP, NUM_SHADES + 1)
    strips = [[(a, 0.0), (b, 0.0)] for a, b in itertools.pairwise(edges)]
    colours = palette.age_colours(np.linspace(0.0, full_scale, NUM_SHADES), full_scale)
    ramp = rr.LineStrips2D(strips, colors=colours, radii=-5.0)
    out.fixed(layers.LEGEND.below("ramp"), ramp)
    texts = ["0", f"{full_scale / 2:g}", f"{full_scale:g} windows"]
    places = [(LEFT + at * RAMP, BELOW) for at in (0.0, 0.5, 0.95)]
    out.words(layers.LEGEND.below("ages"), texts, places)
    about = f"age of what r{out.log.ego} knows"
    out.words(layers.LEGEND.below("about_ages"), [about], [(LEFT + RAMP / 2, ROW)])


def legend_rows(out: RerunLog) -> list[list[LegendSample]]:
    """Return the legend of what was drawn so far."""
    drawn = out.drawn
    return legend(out.log, drawn.link_kinds, is_any_cut_off=drawn.is_any_cut_off)


def legend_height(log: Log, num_rows: int) -> float:
    """Return the height of the legend's view."""
    return num_rows * _row_height(log) - ROW + LAST


def _row_height(log: Log) -> float:
    return ROW + LINE if log.is_compared else ROW


def _sample(sample: LegendSample, x: float, y: float) -> rr.AsComponents:
    """Return a sample in its layer's look, amid this place."""
    layer = sample.layer
    if sample.colour is not None:
        layer = replace(layer, colour=sample.colour)
    match layer:
        case Lines():
            way = x + SAMPLE * (sample.pieces - 0.5)
            return layer.look(strips=[[(a, y), (b, y)] for a, b in way])
        case Arrows():
            start = (x - SAMPLE / 2, y)
            return layer.look(origins=[start], vectors=[(sample.share * SAMPLE, 0.0)])
        case Rings():
            return layer.look(centers=[(x, y)], half_sizes=[(sample.radius, sample.radius)])
        case Points():
            return layer.look(positions=[(x, y)])
