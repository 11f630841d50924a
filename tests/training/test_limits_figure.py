from dataclasses import replace

import numpy as np
import pytest
from synthetic import result

from training.limits_figure import draw_limits, read_floor

HEADER = "range_ratio,floor_windows,commit\n"


@pytest.fixture
def floor(tmp_path):
    path = tmp_path / "floor.csv"
    path.write_text(HEADER + "0.5,1.0,abcdef012345\n0.25,2.0,abcdef012345\n0.25,3.0,abcdef012345\n")
    return path


def test_the_floor_is_the_mean_over_the_teams_of_a_range_ratio(floor):
    with np.errstate(invalid="ignore", divide="ignore"), pytest.warns(RuntimeWarning):
        curve, made_by = read_floor(floor)  # one team alone has no standard error
    assert curve.x.tolist() == [0.25, 0.5]
    assert curve.mean.tolist() == [2.5, 1.0]
    assert curve.sem[0] == pytest.approx(0.5)  # std of 2 and 3 is 1 / sqrt(2), of 2 teams
    assert made_by == "abcdef012345"


def test_floors_of_two_commits_are_refused(floor):
    floor.write_text(floor.read_text() + "0.5,1.0,beef\n")
    with pytest.raises(ValueError, match="must be of one commit"):
        read_floor(floor)


def test_the_floor_is_named_under_the_policies_and_its_commit_stands_below(floor):
    floor.write_text(floor.read_text() + "0.5,1.2,abcdef012345\n")
    base = replace(result("tdma"), task="stationary", num_robots=40)
    rows = [replace(base, range_ratio=x, aoi_mean=9.0) for x in (0.25, 0.5)]
    figure = draw_limits(rows, *read_floor(floor))
    texts = {text.get_text() for text in figure.findobj(lambda a: hasattr(a, "get_text"))}
    assert {"TDMA", "proven floor"} <= texts
    assert any("abcdef0" in text for text in texts)
