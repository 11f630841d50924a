"""The README's chart has the lines of its table, with its numbers."""

import re
from pathlib import Path

import pytest
import readme_figure as program

from swarm_mj.evaluation.results import read_results

ROOT = Path(__file__).parent.parent.parent
LABELS = {
    "planner": "planner +",
    "gnn": "gnn (T, M, P only)",
    "tdma": "TDMA",
    "the paper's GNN": "the paper's GNN, published",
    "random-flooding": "random flooding",
}


@pytest.fixture(scope="module")
def axes():
    results = read_results(ROOT / "training" / "results" / "paper-random-walk.csv")
    return program.draw(results).axes[0]


def table():
    """The README's rows: ages at 10, 20, 40 and 80 robots by the beginning of their names."""
    text = (ROOT / "README.md").read_text()
    for name in LABELS:
        (row,) = re.findall(rf"^\| `?{name}\b.*$", text, re.MULTILINE)
        yield name, [float(number) for number in re.findall(r"([\d.]+) ± ", row)]


def test_the_chart_has_the_lines_of_the_table_and_their_numbers(axes):
    lines = {bars.get_label(): bars.lines[0] for bars in axes.containers}
    assert set(lines) == set(LABELS.values())
    for name, ages in table():
        drawn = dict(zip(*lines[LABELS[name]].get_data(), strict=True))
        assert [round(drawn[x], 1) for x in (10, 20, 40, 80)] == pytest.approx(ages, abs=0.11)


def test_it_is_drawn_from_the_committed_results(tmp_path):
    assert program.ReadmeFigure(out=tmp_path / "readme")() == 0
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".png", ".svg"]
    assert "commit 940af7a" in (tmp_path / "readme.svg").read_text()
