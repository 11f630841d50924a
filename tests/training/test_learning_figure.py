"""The learning curve is drawn where its file says, beside the levels."""

from pathlib import Path

import learning_figure as program
import numpy as np
import pytest

FILE = Path(__file__).parent.parent.parent / "training" / "learning_figure.py"
CURVE = "decisions,minutes,aoi,aoi_sem,other\n0,0.5,60,4,\n10000,2.5,30,2,1.5\n20000,4.5,24,1,1.4\n"
LEVELS = {"tdma": 26.0, "spatial-tdma": 13.0}


@pytest.fixture
def curve(tmp_path):
    (tmp_path / "curve.csv").write_text(CURVE)
    return program.read_curve(tmp_path / "curve.csv")


def test_a_curve_is_read_by_the_names_of_its_columns(curve):
    assert curve["minutes"].tolist() == [0.5, 2.5, 4.5]
    assert curve["aoi"].tolist() == [60.0, 30.0, 24.0]


def test_the_line_stands_where_the_file_says(curve):
    line = program.draw(curve, LEVELS).axes[0].lines[0]
    np.testing.assert_allclose(line.get_xdata(), [0.5, 2.5, 4.5])
    np.testing.assert_allclose(line.get_ydata(), [60, 30, 24])


def test_the_band_is_the_standard_error(curve):
    (band,) = program.draw(curve, LEVELS).axes[0].collections
    corners = {tuple(corner) for corner in band.get_paths()[0].vertices}
    assert corners >= {(0.5, 56), (0.5, 64), (4.5, 23), (4.5, 25)}


def test_levels_are_named_with_their_cost(curve):
    (axes,) = program.draw(curve, LEVELS).axes
    assert {text.get_text() for text in axes.texts} == {"TDMA 26.0", "spatial TDMA 13.0"}
    assert {line.get_ydata()[0] for line in axes.lines} >= {26.0, 13.0}
    assert axes.get_ylim()[1] > 26.0


def test_the_committed_results_are_drawn_with_their_caption(tmp_path, monkeypatch):
    monkeypatch.chdir(FILE.parent.parent)
    assert program.LearningFigure(out=tmp_path / "learning")() == 0
    drawn = (tmp_path / "learning.svg").read_text()
    assert program.SAID in drawn
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".png", ".svg"]


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", CURVE + "x,y,2,3,4\n"])
def test_what_is_no_curve_is_refused(tmp_path, text):
    (tmp_path / "other.csv").write_text(text)
    with pytest.raises(ValueError, match=r"other\.csv is no learning curve"):
        program.read_curve(tmp_path / "other.csv")
