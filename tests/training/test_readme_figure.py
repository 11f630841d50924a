"""The README's chart has the lines of its table, with its numbers."""

import re
from pathlib import Path

import pytest
import readme_figure as program

from swarm_mj.evaluation.results_files import read_results

ROOT = Path(__file__).parent.parent.parent
RESULTS = ROOT / "training" / "results" / "paper-random-walk.csv"
LABELS = {
    "planner": "planner +",
    "sotdma": "sotdma",
    "index-csma": "index-csma",
    "gnn": "gnn",
    "tdma": "tdma",
    "random-flooding": "random-flooding",
}
PAPERS = "the paper's GNN, published"


@pytest.fixture(scope="module")
def axes():
    return program.draw(read_results(RESULTS)).axes[0]


def table():
    """The README's rows: ages of walking teams of 40 by their policies."""
    text = (ROOT / "README.md").read_text()
    for name in LABELS:
        (row,) = re.findall(rf"^\| `{name}`.*$", text, re.MULTILINE)
        _, walking, *_ = [float(number) for number in re.findall(r"\| ([\d.]+) ± ", row)]
        yield name, walking


def test_the_chart_has_the_lines_of_the_table_and_their_numbers(axes):
    lines = {bars.get_label(): bars.lines[0] for bars in axes.containers}
    assert set(lines) == {PAPERS, *LABELS.values()}
    for name, age in table():
        drawn = dict(zip(*lines[LABELS[name]].get_data(), strict=True))
        assert round(drawn[40], 1) == pytest.approx(age, abs=0.11)


def test_it_is_drawn_from_the_committed_results(tmp_path):
    assert program.ReadmeFigure(out=tmp_path / "readme")() == 0
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".png", ".svg"]
    commit = read_results(RESULTS)[0].commit
    assert re.search(rf"commit {commit[:7]}", (tmp_path / "readme.svg").read_text())
