"""What is in a figure: the curves' numbers, their errors, labels and names."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.text import Text
from scipy.optimize import minimize
from synthetic import everything, result, sweep

from swarm_mj.evaluation.figures.curves import NoPointsError
from swarm_mj.evaluation.figures.drawing import draw, keep_apart
from swarm_mj.evaluation.figures.style import BETTER, LOOKS
from swarm_mj.evaluation.published import RESULT_FIGURES

FIG3, FIG4, _, FIG6 = RESULT_FIGURES.values()
FLOODING = {0.2: (70.0, 3.0), 0.5: (16.0, 0.5), 1.0: (12.0, 0.25)}
PAYLOADS = {"planner": "snapshots"}


def bars(axes):
    """The error bars by label: line, lower and upper ends."""
    found = {}
    for container in axes.containers:
        line, _, (columns,) = container
        ends = [(low, high) for (_, low), (_, high) in filter(len, columns.get_segments())]
        found[container.get_label()] = line, *np.reshape(ends, (-1, 2)).T
    return found


def names(axes):
    return {text.get_text(): text for text in axes.texts}


def test_a_curve_has_its_points_and_errors_and_the_published_one_is_dashed_and_hollow():
    (axes,) = draw(FIG4, sweep("random-flooding", "range_ratio", FLOODING)).axes
    found = bars(axes)
    others = ("mst", "round-robin", "GNN")
    assert set(found) - {"random-flooding"} == {
        f"{name}, published" for name in ("random-flooding", *others)
    }
    ours, low, high = found["random-flooding"]
    np.testing.assert_array_equal(ours.get_xdata(), [0.2, 0.5, 1.0])
    np.testing.assert_array_equal(ours.get_ydata(), [70.0, 16.0, 12.0])
    np.testing.assert_allclose(low, [67.0, 15.5, 11.75])
    np.testing.assert_allclose(high, [73.0, 16.5, 12.25])
    theirs, low, high = found["random-flooding, published"]
    np.testing.assert_array_equal(theirs.get_xdata(), [0.2, 0.25, 0.5, 0.75, 1.0])
    assert theirs.get_ydata()[0] == 72.633
    np.testing.assert_allclose((high - low)[0], 2 * 1.53417)  # std 15.3417 of 100 missions
    assert (theirs.get_linestyle(), ours.get_linestyle()) == ("--", "-")
    assert theirs.get_markerfacecolor() == "white"
    assert ours.get_markerfacecolor() == ours.get_color() == theirs.get_color()


def test_a_logarithmic_axis_leaves_the_same_room_at_both_ends_by_hand():
    """Error bars from 1 to 1e6, and at each end 6 % of these six decades."""
    ours = sweep("random-flooding", "range_ratio", {0.2: (1e6 - 1e5, 1e5), 1.0: (1.5, 0.5)})
    (axes,) = draw(FIG4, ours).axes
    assert axes.get_yscale() == "log"
    np.testing.assert_allclose(np.log10(axes.get_ylim()), [-0.36, 6.36])


def test_every_method_is_named_once_and_slanted_if_only_the_paper_has_it():
    (axes,) = draw(FIG4, [result("mst"), result("something-new")]).axes
    styles = {name: text.get_fontstyle() for name, text in names(axes).items()}
    assert styles == {
        "mst": "normal",
        "something-new": "normal",
        "random-flooding": "italic",
        "round-robin": "italic",
        "GNN": "italic",
    }
    assert names(axes)["something-new"].xy == (0.25, 1.0)
    assert names(axes)["GNN"].xy == (1.0, 8.57)


def test_a_curve_that_ends_early_is_named_beside_its_end():
    """A leader to the right edge would cross the others' curves like data."""
    ours = [*sweep("random-flooding", "range_ratio", FLOODING), result("tdma", aoi_mean=26.0)]
    (axes,) = draw(FIG4, ours).axes
    ends = axes.transAxes.inverted().transform(axes.transData.transform([(0.25, 26.0)]))
    np.testing.assert_allclose(names(axes)["tdma"].get_position(), ends[0] + (0.02, 0.0))
    assert names(axes)["random-flooding"].get_position()[0] > 1.0


def test_only_what_is_asked_for_is_drawn():
    """The published curve of a policy, and a GNN of the paper's."""
    ours = [result("mst"), result("tdma", commit="def456"), result("gossip")]
    drawing = draw(FIG4, ours, ("mst", "GNN", "gossip"))
    (axes,) = drawing.axes
    assert set(bars(axes)) == {"mst", "mst, published", "GNN, published", "gossip"}
    assert "def456" not in drawing.texts[-1].get_text()
    with pytest.raises(NoPointsError, match="fig4 has no points of aloha"):
        draw(FIG4, ours, ("aloha",))


def test_who_carries_more_than_the_paper_s_packets_is_marked_and_the_mark_explained():
    marked = [result("planner", payload="snapshots"), result("tdma", payload="none")]
    drawing = draw(FIG4, marked)
    (axes,) = drawing.axes
    assert {"planner +", "tdma"} < set(names(axes))
    assert {"planner +", "tdma"} < set(bars(axes))
    texts = [text.get_text() for text in drawing.legends[0].get_texts()]
    assert texts[2:] == ["+: larger packets"]
    plain = draw(FIG4, [result("tdma", payload="none")])
    assert len(plain.legends[0].get_texts()) == 2


def test_a_level_is_a_line_with_a_band():
    (axes,) = draw(FIG3, [result("tdma", aoi_mean=26.0, aoi_sem=0.5)]).axes
    lines = {line.get_label(): line for line in axes.lines}
    np.testing.assert_array_equal(lines["tdma"].get_ydata(), [26.0, 26.0])
    np.testing.assert_array_equal(lines["tdma"].get_xdata(), [0.0, 5.0])
    assert lines["mst, published"].get_linestyle() == "--"
    band = next(c for c in axes.collections if isinstance(c, PolyCollection))
    height = band.get_paths()[0].vertices[:, 1]
    assert (height.min(), height.max()) == (25.5, 26.5)
    np.testing.assert_array_equal(bars(axes)["GNN, published"][0].get_xdata(), range(6))


def test_a_band_reaches_from_the_best_to_the_worst_training():
    curves = {"GNN": (20.0, 10.0), "GNN, seed 2": (24.0, 9.0)}
    results = [
        each
        for name, (at_20, at_50) in curves.items()
        for each in sweep(name, "range_ratio", {0.2: (at_20, 1.0), 0.5: (at_50, 1.0)})
    ]
    (axes,) = draw(FIG4, results, ["GNN"]).axes
    band = next(c for c in axes.collections if isinstance(c, PolyCollection))
    assert set(map(tuple, band.get_paths()[0].vertices)) == {
        (0.2, 20.0), (0.2, 24.0), (0.5, 9.0), (0.5, 10.0),
    }  # fmt: skip
    np.testing.assert_array_equal(bars(axes)["GNN"][0].get_ydata(), [22.0, 9.5])


def test_panels_have_one_height_in_every_figure():
    """3.3 inches, 0.35 between two, 0.86 above and 0.75 below them."""
    one, two = draw(FIG4, everything()), draw(FIG6, everything())
    for drawing, places in ((one, [(0.75, 4.05)]), (two, [(4.4, 7.7), (0.75, 4.05)])):
        height_in = drawing.get_figheight()
        found = [np.multiply(axes.get_position().intervaly, height_in) for axes in drawing.axes]
        np.testing.assert_allclose(found, places)
        assert height_in == pytest.approx(places[0][1] + 0.86)


def test_flocking_has_a_panel_for_each_cost():
    results = [result("mst", "flocking", velocity_variance_mean=0.2, velocity_variance_sem=0.01)]
    above, below = draw(FIG6, results).axes
    assert above.get_title("left") == "age of information [windows]"
    assert below.get_title("left") == "velocity variance [m²/s²]"
    assert bars(below)["mst"][0].get_ydata() == [0.2]
    assert bars(below)["mst, published"][0].get_ydata()[0] == 0.1866
    assert below.get_xlabel().endswith("[km in 50 s]")


def test_fig6_what_perfect_knowledge_would_reach_stands_below_every_curve_of_the_variance():
    """Also where only some policies are drawn; the age has no such line."""
    results = [result("mst", "flocking", velocity_variance_mean=0.2, velocity_variance_sem=0.01)]
    for methods in ((), ("mst",)):
        above, below = draw(FIG6, results, methods).axes
        assert "perfect knowledge" not in names(above)
        assert "perfect knowledge" in names(below)
        line, *_ = bars(below)["perfect knowledge"]
        np.testing.assert_array_equal(line.get_xdata(), [0.15, 0.25, 0.325, 0.5])
        assert line.get_ydata()[0] == pytest.approx(0.0499, abs=1e-4)
        lowest = min(min(its.get_ydata()) for its, *_ in bars(below).values())
        assert lowest == line.get_ydata()[0]
        assert below.get_ylim()[0] < lowest


@pytest.mark.parametrize("figure", RESULT_FIGURES.values(), ids=lambda figure: figure.name)
def test_title_regime_and_caption_say_what_is_shown(figure):
    drawing = draw(figure, everything())
    texts = [text.get_text() for text in drawing.texts]
    assert figure.title in texts
    assert texts[-1] == (
        f"{figure.name}, preset reference: 4 missions, seeds 50 to 53, 500 windows each; "
        "swarm_mj 1.2.3, commit abc123"
    )
    (legend,) = drawing.legends
    assert [text.get_text().split(",")[0] for text in legend.get_texts()] == [
        "this package",
        "published",
    ]
    assert all("SEM" in text.get_text() for text in legend.get_texts())
    regime = {
        "fig3": "stationary, 40 robots, range ratio 0.25",
        "fig4": "stationary, 40 robots",
        "fig5": "random walk, range ratio 0.25, velocity ratio 0.15",
        "fig6": "flocking, 40 robots, range ratio 0.25",
    }
    assert regime[figure.name] in texts


def test_ticks_are_the_published_places_and_all_curves_are_inside():
    (axes,) = draw(
        FIG4, sweep("greedy-oracle", "range_ratio", {0.2: (20.0, 0.5), 0.3: (11.0, 0.1)})
    ).axes
    np.testing.assert_array_equal(axes.get_xticks(), [0.2, 0.25, 0.3, 0.5, 0.75, 1.0])
    low, high = axes.get_ylim()
    assert low < 8.57
    assert high > 72.633


# Not in this figure: limits, which have one of their own, with fewer policies, and grey `sotdma`.
LEFT_OUT = ("floor", "training.ceiling:Annealed", "perfect knowledge", "sotdma")


def test_nothing_that_is_written_overlaps_or_leaves_the_page():
    ends = {"range_ratio": 1.0}  # of the published curves
    every = [
        result(policy, aoi_mean=12.0 + 0.1 * n, **ends, payload=PAYLOADS.get(policy))
        for n, policy in enumerate(sorted({*LOOKS} - {BETTER, *LEFT_OUT}))
    ]
    drawing = draw(FIG4, every)
    FigureCanvasAgg(drawing).draw()
    (axes,) = drawing.axes
    ticks = [*axes.get_xticklabels(), axes.xaxis.label]
    written = [*drawing.texts, *axes.texts, *ticks, *drawing.legends[0].get_texts()]
    heading = next(text for text in axes.findobj(Text) if text.get_text() == axes.get_title("left"))
    boxes = [Text.get_window_extent(text) for text in [*written, heading] if text.get_text()]
    for index, box in enumerate(boxes):
        assert drawing.bbox.x0 <= box.x0 <= box.x1 <= drawing.bbox.x1
        assert drawing.bbox.y0 <= box.y0 <= box.y1 <= drawing.bbox.y1
        assert not any(box.overlaps(other) for other in boxes[:index])


@pytest.mark.parametrize(
    ("wanted", "gap", "places"),
    [
        ([0.9, 0.1, 0.5], 0.1, [0.9, 0.1, 0.5]),  # room for all
        ([0.5, 0.5], 0.2, [0.4, 0.6]),  # two in one place part by half a gap each
        ([1.0, 1.0, 0.0], 0.2, [0.8, 1.0, 0.0]),  # inside the ends
        ([0.0, 0.5, 1.0], 1.0, [0.0, 1.0, 2.0]),  # more than fit keep their distance
    ],
)
def test_names_are_kept_apart_by_hand(wanted, gap, places):
    np.testing.assert_allclose(keep_apart(np.array(wanted), gap), places)


@pytest.mark.parametrize("seed", range(5))
def test_they_are_as_near_as_can_be(seed):
    """Against a general solver of the same least squares."""
    rng, gap = np.random.default_rng(seed), 0.11
    wanted = np.sort(rng.uniform(0.0, 1.0, size=7))
    apart = {"type": "ineq", "fun": lambda places: np.diff(places) - gap}
    solved = minimize(
        lambda places: np.sum((places - wanted) ** 2),
        np.linspace(0.0, 1.0, 7),
        bounds=[(0.0, 1.0)] * 7,
        constraints=apart,
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    np.testing.assert_allclose(keep_apart(wanted, gap), solved.x, atol=1e-5)
