"""The learning curve is drawn where its file says, beside the levels."""

from pathlib import Path

import learning_figure as program
import pytest

from swarm_mj.learning.run_folder import read_curve

FILE = Path(__file__).parent.parent.parent / "training" / "learning_figure.py"


def test_the_committed_results_are_drawn_with_their_caption(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(program, "save", lambda figure, path: drawn.append((figure, path.name)))
    assert program.LearningFigure(out=tmp_path / "learning")() == 0
    (figure, first), (_, second) = drawn
    assert (first, second) == ("learning.svg", "learning.png")
    (axes,) = figure.axes
    rows = read_curve(program.RESULTS / "rest-curve.csv")
    assert axes.lines[0].get_xdata().tolist() == [row["decisions"] for row in rows]
    assert axes.lines[0].get_ydata().tolist() == [row["aoi"] for row in rows]
    (band,) = axes.collections
    low = rows[0]["aoi"] - rows[0]["aoi_sem"]
    assert band.get_paths()[0].vertices[:, 1].tolist().count(pytest.approx(low)) > 0
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == [program.LABEL, "TDMA 32.8", "spatial TDMA 26.0"]


def test_the_committed_figure_has_the_caption():
    assert program.SAID in (FILE.parent.parent / "assets/figures/learning.svg").read_text()
