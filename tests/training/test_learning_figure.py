"""The learning curve is drawn where its file says, with the schedules' ages as levels."""

import shutil
from pathlib import Path

import learning_figure as program
import pytest
from synthetic import result

from swarm_mj.evaluation.results_files import write_results
from swarm_mj.learning.run_folder import read_curve

ROOT = Path(__file__).parents[2]
AGES = {"tdma": {20: 10.0, 40: 24.0, 80: 65.0}, "spatial-tdma": {20: 8.0, 40: 20.0, 80: 50.0}}


def levels():
    """Results of both schedules, and of others that are no levels."""
    sizes = [(policy, *each) for policy, ages in AGES.items() for each in ages.items()]
    return [
        *(result(policy, aoi_mean=age, num_robots=size) for policy, size, age in sizes),
        result("tdma", aoi_mean=1.0, num_robots=10),
        result("tdma", "random-walk", aoi_mean=1.0, num_robots=40),
        result("gnn", aoi_mean=1.0, num_robots=40),
    ]


@pytest.fixture
def results(tmp_path):
    """The committed curve beside made-up levels."""
    (tmp_path / "learning").mkdir()
    shutil.copy(program.RESULTS / program.CURVE, tmp_path / program.CURVE)
    write_results(tmp_path / "shipped-gnn.csv", levels())
    return tmp_path


def test_the_curve_is_drawn_with_the_levels_and_a_caption(results, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(program, "save", lambda figure, path: drawn.append((figure, path.name)))
    assert program.LearningFigure(out=tmp_path / "learning", results=results)() == 0
    (figure, first), (_, second) = drawn
    assert (first, second) == ("learning.svg", "learning.png")
    (axes,) = figure.axes
    rows = read_curve(program.RESULTS / program.CURVE)
    assert axes.lines[0].get_xdata().tolist() == [row.decisions for row in rows]
    assert axes.lines[0].get_ydata().tolist() == [row.aoi for row in rows]
    (band,) = axes.collections
    low = rows[0].aoi - rows[0].aoi_sem
    assert band.get_paths()[0].vertices[:, 1].tolist().count(pytest.approx(low)) > 0
    labels = [" ".join(text.get_text().split()) for text in axes.get_legend().get_texts()]
    assert labels == [program.LABEL, "tdma 33.0", "spatial-tdma 26.0"]


def test_the_caption_has_the_missions_and_both_commits(results):
    said = program.caption(program.read_levels(results / "shipped-gnn.csv"))
    assert said.startswith("Curve: 12 held-out missions a size")
    assert "commit e15dd2968009. Levels: 4 missions a size from seed 50, commit abc123" in said


def test_levels_that_are_missing_are_refused(results):
    write_results(results / "shipped-gnn.csv", levels()[1:])
    with pytest.raises(ValueError, match="tdma and spatial-tdma in teams of"):
        program.read_levels(results / "shipped-gnn.csv")


def test_the_committed_figure_has_the_caption_of_the_committed_results():
    said = program.caption(program.read_levels(program.RESULTS / "shipped-gnn.csv"))
    assert said in (ROOT / "assets/figures/learning.svg").read_text()
