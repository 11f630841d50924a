"""The figure of crashes, from a few rows that are in view."""

from dataclasses import replace

import pytest
from crashes_figure import crashed, draw, news_age, table
from synthetic import result

NEWS = "training.examples.avoiding:"


def row(policy, controller, density, age, mean, worst):
    """A result of quadrotors."""
    return result(
        policy=policy,
        task="random-walk",
        robot="quadrotor",
        controller=NEWS + controller,
        aoi_mean=age,
        crashed_mean=mean,
        crashed_worst=worst,
        density_per_km2=density,
    )


@pytest.fixture
def found():
    """Two densities, the truth at two ages, and a policy."""
    return [
        row("tdma", "Errands", 1000.0, 9.4, 0.2, 2.0),
        row("tdma", "Errands", 3000.0, 9.5, 1.0, 4.0),
        row("tdma", "four_seconds", 1000.0, 9.4, 5.0, 10.0),
        row("tdma", "four_seconds", 3000.0, 9.4, 14.5, 18.0),
        row("tdma", "fresh", 1000.0, 9.4, 0.0, 0.0),
        row("tdma", "fresh", 3000.0, 9.4, 0.0, 0.0),
    ]


def test_the_age_of_delayed_news_is_its_delay(found):
    assert [news_age(each) for each in found] == [9.4, 9.5, 40.0, 40.0, 0.0, 0.0]


def test_points_and_lines_are_where_the_numbers_are(found):
    figure = draw(found)
    loose, dense = figure.axes
    line, worst, mean = dense.lines
    assert list(line.get_xdata()) == [0.0, 40.0]
    assert list(line.get_ydata()) == [0.0, 14.5]
    assert list(worst.get_ydata()) == [1.0, 4.0]
    assert (list(mean.get_xdata()), list(mean.get_ydata())) == ([9.5], [1.0])
    assert list(loose.lines[0].get_ydata()) == [0.0, 5.0]


def test_the_table_has_all_by_age(found, monkeypatch, tmp_path):
    monkeypatch.setattr("crashes_figure.read_results", lambda _path: found)
    lines = table(tmp_path).splitlines()
    assert lines[2:] == [
        "| the truth | 0.0 | 0.0 (0) | 0.0 | 0.0 (0) |",
        "| `tdma` | 9.4 | 0.2 (2) | 9.5 | 1.0 (4) |",
        "| the truth, 40 windows old | 40.0 | 5.0 (10) | 40.0 | 14.5 (18) |",
    ]


def test_robots_that_cannot_crash_are_refused(found):
    point = replace(found[0], crashed_mean=None, robot="point")
    with pytest.raises(ValueError, match="point cannot crash"):
        crashed(point)
