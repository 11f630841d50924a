"""The seeds' learning curves are drawn where their table says, each kind with its spread."""

from pathlib import Path

import numpy as np
import pytest
import stability_figure as program

FILE = Path(__file__).parents[2] / "training" / "stability_figure.py"
CURVES = """training,decisions,aoi,velocity_variance,more
age-1,0,90,0.5,
age-1,100,40,0.3,1
age-2,0,80,0.5,
age-2,100,50,0.1,1
variance-1,0,90,0.4,
variance-1,100,70,0.2,1
credit,0,95,0.6,
"""
TRAININGS = """training,commit,settings
age-1,abc,"{""robots"": [10]}"
age-2,abc,"{""robots"": [10]}"
credit,abc,"{""robots"": [40]}"
"""


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "curves.csv"
    path.write_text(CURVES)
    return path


def test_seeds_their_mean_and_their_band(table):
    age, variance = program.draw(program.read_curves(table), "abc").axes
    first, second, mean, alone, its_mean = age.lines
    np.testing.assert_allclose(mean.get_xdata(), [0, 100])
    np.testing.assert_allclose(first.get_ydata(), [90, 40])
    np.testing.assert_allclose(second.get_ydata(), [80, 50])
    np.testing.assert_allclose(mean.get_ydata(), [85, 45])
    np.testing.assert_allclose(alone.get_ydata(), its_mean.get_ydata())
    band, _ = age.collections
    corners = {tuple(corner) for corner in band.get_paths()[0].vertices}
    assert {(0, 80), (0, 90), (100, 40), (100, 50)} <= corners
    np.testing.assert_allclose(variance.lines[2].get_ydata(), [0.5, 0.2])


def test_the_caption_says_how_many_seeds_and_which_commit(table):
    said = [text.get_text() for text in program.draw(program.read_curves(table), "abc").texts]
    assert any("seeds: 2 of age, 1 of variance" in text for text in said)
    assert any(text.endswith("; abc") for text in said)


@pytest.mark.usefixtures("table")
def test_the_files_are_written_where_the_options_say(tmp_path):
    (tmp_path / "trainings.csv").write_text(TRAININGS)
    assert program.StabilityFigure(out=tmp_path / "new" / "curves", trained=tmp_path)() == 0
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == [
        "curves.png",
        "curves.svg",
    ]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("age-2,100,50,0.1,1\n", "", "curves of age need the same decisions"),
        ("variance-1", "task-1", "curves of variance need the same decisions, and one seed"),
        ("velocity_variance", "variance", "is no table with"),
        (",40,", ",forty,", "is no table with"),
    ],
)
def test_a_table_of_something_else_is_refused(table, old, new, said):
    table.write_text(CURVES.replace(old, new))
    with pytest.raises(ValueError, match=said):
        program.read_curves(table)


def test_the_origin_is_one_commit_and_one_team_size(tmp_path):
    path = tmp_path / "trainings.csv"
    path.write_text(TRAININGS)
    assert program.read_origin(path) == "teams of 10 robots, shared reward, commit abc"
    others = (("age-2,abc", "age-2,def"), ("[10]", "[20]"), (TRAININGS.partition("\n")[2], ""))
    for old, new in others:
        path.write_text(TRAININGS.replace(old, new, 1))
        with pytest.raises(ValueError, match="needs one commit and one team size"):
            program.read_origin(path)
