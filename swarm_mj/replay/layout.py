"""The replay's layout, stored as rerun's blueprint, and the map's legend: rerun has none."""

import itertools
import re
from typing import Any, TypeAlias

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from swarm_mj.replay import palette
from swarm_mj.replay.charts import STATES, TREE, PlotCurve, plots
from swarm_mj.replay.footage import Ground
from swarm_mj.replay.links import PIECES, WHOLE, by_kind
from swarm_mj.replay.recorder import Log, in_matrix
from swarm_mj.replay.rerun_log import LAYERS, TIMELINE, RerunLog
from swarm_mj.replay.stage import square_m

WINDOWS_PER_SECOND = 30.0  # windows of 100 ms: three times as fast as the mission
MARGIN = 1.06  # of the map, around what it must show

WIDTH = 100.0  # of the legend's view, in units of its own, y down
LEFT, RAMP = 4.0, 31.0  # where the ramp of ages begins, and how long it is
COLUMN, ROW = 14.2, 8.4  # from one sample to the next, to the right of the ramp
SAMPLE = 5.0  # the length of a sample
RADII = {"radio/range": 2.0, "belief/ring": 0.8}  # of sampled rings
LAST = 5.1  # the height of the last row, with its texts
LINE = 1.9  # of a text's second line, which they have beyond free space only
BELOW = 2.6  # from a sample to its text
NUM_SHADES = 60

Range: TypeAlias = tuple[float, float]


class Layout(rrb.Blueprint):
    """A blueprint that can be closed; rerun would keep the stream and two threads of each."""

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        super()._log_to_stream(stream)

    def close(self) -> None:
        """Release the stream, once it was sent."""
        self._stream.disconnect()
        del self._stream


def layout(log: Log, ground: Ground) -> Layout:
    """Return the blueprint: tabs of the mission, its scene, and the radio of every robot."""
    across = -MARGIN * ground.reach_m, MARGIN * ground.reach_m
    height = legend_height(log)
    name = f"Map, squares of {square_m(ground):g} m" + ", follows the team" * ground.moves
    map_view = _drawing("/", name, across, across, contents=["/arena/**"], **_hidden("arena"))
    samples = _drawing("/legend", "Legend", (0.0, WIDTH), (-3.5, height), titlebar=False)
    across, up = ((-0.05 * size, 1.05 * size) for size in TREE)
    tree = _drawing("/tree", f"Tree of r{log.ego}, in hops", across, up)
    every = in_matrix(log.facts.mission.num_robots).step
    ages = "Ages: rows about columns" + (f", every {every}th robot" if every > 1 else "")
    matrix = _drawing("/", ages, (0.0, TREE[0]), (0.0, TREE[1]), contents=["/ages"])
    charts = [_plot(name, curves) for name, curves in plots(log).items()]
    mission = rrb.Horizontal(
        rrb.Vertical(map_view, samples, row_shares=[4, height / (ROW + LAST)]),
        rrb.Vertical(rrb.Horizontal(tree, matrix), *charts, row_shares=[4, *[3] * len(charts)]),
        column_shares=[11, 10],
        name="Mission",
    )
    states = "delivers (green), is lost (orange), answers (blue), overhears (pink)"
    if log.facts.is_broadcast:
        states = "transmits (blue), hears (dark)"
    across, up = ((-0.07 * size, 1.02 * size) for size in STATES)
    radio = rrb.Horizontal(
        _drawing("/", f"Radio of every robot: {states}", across, up, contents=["/state/**"]),
        rrb.TextDocumentView(origin="/about", name="About this mission"),
        column_shares=[3, 1],
        name="Radio",
    )
    time = {"timeline": TIMELINE, "fps": WINDOWS_PER_SECOND, "loop_mode": "all"}
    tabs = rrb.Tabs(mission, _scene(ground.reach_m), radio, active_tab=0)
    panel = rrb.TimePanel(state="collapsed", **time)
    return Layout(tabs, panel, collapse_panels=True, auto_views=False)


def _hidden(view: str) -> dict[str, Any]:
    """Hide the links between others than the observer; the viewer can show them."""
    unseen = rrb.EntityBehavior(visible=False)
    return {"overrides": {f"/{view}/world/others/{kind}": unseen for kind in palette.MISMATCH}}


def _scene(reach_m: float) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin="/",
        contents=["/scene/**"],
        **_hidden("scene"),
        name="Scene in 3-D, colours as on the map",
        background=palette.BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(0.0, -1.35 * reach_m, 1.75 * reach_m),
            look_target=(0.0, -0.12 * reach_m, 0.0),
            eye_up=(0.0, 0.0, 1.0),
        ),
    )


def _drawing(
    origin: str, name: str, x_range: Range, y_range: Range, **options: Any
) -> rrb.Spatial2DView:
    # The background is set so that colours do not depend on the viewer's theme.
    bounds = rrb.VisualBounds2D(x_range=x_range, y_range=y_range)
    return rrb.Spatial2DView(
        origin=origin, name=name, background=palette.BACKGROUND, visual_bounds=bounds, **options
    )


def _plot(name: str, curves: list[PlotCurve]) -> rrb.TimeSeriesView:
    unseen = rrb.EntityBehavior(visible=False)
    hidden: dict[Any, Any] = {f"/plots/{each.path}": unseen for each in curves if each.is_hidden}
    seen = [each for each in curves if not each.is_hidden]
    top = palette.nice_top(max(float(np.max(each.values + each.std)) for each in seen))
    return rrb.TimeSeriesView(
        overrides=hidden,
        axis_y=rrb.ScalarAxis(range=(0.0, 1.06 * top)),  # so that both ends have numbers
        origin=f"/plots/{curves[0].path.split('/')[0]}",
        name=name,
        plot_legend=rrb.PlotLegend(visible=False),  # it would cover curves; the name says the same
        background=rrb.archetypes.PlotBackground(color=palette.PLOT, show_grid=False),
    )


def draw_legend(out: RerunLog) -> None:
    """Draw the ramp of ages, and samples of what the map shows."""
    full_scale = out.log.facts.full_scale
    edges = LEFT + np.linspace(0.0, RAMP, NUM_SHADES + 1)
    strips = [[(a, 0.0), (b, 0.0)] for a, b in itertools.pairwise(edges)]
    colours = palette.age_colours(np.linspace(0.0, full_scale, NUM_SHADES), full_scale)
    out.fixed("legend/ramp", rr.LineStrips2D(strips, colors=colours, radii=-5.0))
    texts = ["0", f"{full_scale / 2:g}", f"{full_scale:g} windows"]
    out.words("legend/ages", texts, [(LEFT + at * RAMP, BELOW) for at in (0.0, 0.5, 0.95)])
    out.words("legend/about_ages", [f"age of what r{out.log.ego} knows"], [(LEFT + RAMP / 2, ROW)])
    for row, samples in enumerate(_samples(out.log)):
        for column, (text, layer) in enumerate(samples.items()):
            x, y = LEFT + RAMP + (column + 0.9) * COLUMN, row * _row_height(out.log)
            path = "legend/" + re.sub(r"\W", "_", text)
            _draw_sample(out, path, layer, x, y)
            out.words(f"{path}/text", [text], [(x, y + BELOW)])


def legend_height(log: Log) -> float:
    """Return the height of the legend's view."""
    return len(_samples(log)) * _row_height(log) - ROW + LAST


def _row_height(log: Log) -> float:
    return ROW + LINE if log.is_compared else ROW


def _samples(log: Log) -> list[dict[str, str]]:
    """Return rows of texts with their layers: the radio, what else is shown, mismatched links."""
    own = f"r{log.ego}"
    others = {"heading": "heading", f"{own}'s belief": "belief/ring"} if log.has_motion else {}
    others[f"{own}'s tree"] = "tree"
    # Beyond free space, the circle is what the range would be.
    reach = {"range in\nfree space" if log.is_compared else "radio range": "radio/range"}
    if log.facts.is_broadcast:
        packets = {"transmits": "radio/transmitter", "is heard by": "radio/heard"}
        rows = [packets | reach, others]
    else:
        fates = ("delivered", "lost", "answered", "overheard")
        rows = [{fate: f"radio/{fate}" for fate in fates}, others | reach]
    if not log.is_compared:
        return rows
    texts = {"too_weak": "believed,\ntoo weak", "unbelieved": "works,\nunbelieved"}
    found = {kind for kind, links in by_kind(log.mismatch.links).items() if len(links) > 0}
    row = {text: f"world/{kind}" for kind, text in texts.items() if kind in found}
    if np.any(log.is_cut_off):
        row[f"cut off\nfrom {own}"] = "world/cut_off"
    return [*rows, row] if row else rows


def _draw_sample(out: RerunLog, path: str, name: str, x: float, y: float) -> None:
    layer, radius, kind = LAYERS[f"arena/{name}"], RADII.get(name, 0.0), name.split("/")[-1]
    share = palette.LOST_SHARE if name == "radio/lost" else 1.0
    way = x + SAMPLE * (PIECES.get(kind, WHOLE) - 0.5)
    shapes = {
        rr.LineStrips2D: {"strips": [[(a, y), (b, y)] for a, b in way]},
        rr.Arrows2D: {"origins": [(x - SAMPLE / 2, y)], "vectors": [(share * SAMPLE, 0.0)]},
        rr.Ellipses2D: {"centers": [(x, y)], "half_sizes": [(radius, radius)]},
        rr.Points2D: {"positions": [(x, y)]},
    }
    colour = {"colors": [palette.MISMATCH[kind]]} if kind in palette.MISMATCH else {}
    out.fixed(path, layer.kind.from_fields(**layer.style, **colour, **shapes[layer.kind]))
