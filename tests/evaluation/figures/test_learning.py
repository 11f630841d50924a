"""Learning curves: every seed is drawn where its file says, beside the levels."""

from pathlib import Path

import numpy as np
import pytest

from swarm_mj.evaluation.figures.learning import (
    LearningCurve,
    LearningPanel,
    Level,
    draw_learning,
    read_curve,
)

CURVE = "decisions,minutes,aoi,aoi_sem,other\n0,0.5,60,4,\n10000,2.5,30,2,1.5\n20000,4.5,24,1,1.4\n"


@pytest.fixture
def curve(tmp_path):
    path = tmp_path / "curve.csv"
    path.write_text(CURVE)
    return path


def panel(files, x="decisions"):
    learned = LearningCurve(label="learned", colour="#cc79a7", files=tuple(files))
    levels = (Level(policy="tdma", aoi=26.0), Level(policy="planner", aoi=13.0))
    return LearningPanel(title="a title", x=x, curves=(learned,), levels=levels)


def test_a_curve_is_read_by_the_names_of_its_columns(curve):
    columns = read_curve(curve)
    assert columns["minutes"] == [0.5, 2.5, 4.5]
    assert columns["aoi"] == [60.0, 30.0, 24.0]


@pytest.mark.parametrize(("x", "xs"), [("decisions", [0, 10, 20]), ("minutes", [0.5, 2.5, 4.5])])
def test_lines_stand_where_the_files_say(curve, x, xs):
    axes = draw_learning([panel([curve, curve], x)], "made here").axes[0]
    learned = [line for line in axes.lines if line.get_color() == "#cc79a7"]
    assert len(learned) == 2  # one a seed
    for line in learned:
        np.testing.assert_allclose(line.get_xdata(), xs)
        np.testing.assert_allclose(line.get_ydata(), [60, 30, 24])
    assert learned[0].get_linestyle() != learned[1].get_linestyle()


def test_bands_are_standard_errors(curve):
    axes = draw_learning([panel([curve])], "made here").axes[0]
    corners = axes.collections[0].get_paths()[0].vertices
    assert {tuple(corner) for corner in corners} >= {(0, 56), (0, 64), (20, 23), (20, 25)}


def test_levels_are_named_with_their_cost(curve):
    axes = draw_learning([panel([curve])], "made here").axes[0]
    assert {text.get_text() for text in axes.texts} == {"TDMA 26.0", "planner 13.0"}
    assert {line.get_ydata()[0] for line in axes.lines} >= {26.0, 13.0}
    assert axes.get_ylim()[1] > 26.0


def test_one_name_for_all_seeds_and_one_panel_below_the_other(curve):
    drawing = draw_learning([panel([curve, curve]), panel([curve])], "made here")
    assert len(drawing.axes) == 2
    legend = drawing.axes[0].get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["learned"]


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", CURVE + "x,1,2,3,4\n"])
def test_what_is_no_curve_is_refused(tmp_path, text):
    path = Path(tmp_path / "other.csv")
    path.write_text(text)
    with pytest.raises(ValueError, match=r"other\.csv is no learning curve"):
        read_curve(path)
