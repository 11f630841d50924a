"""The table of learning curves, of runs that are made up."""

import learning as program
import pytest

CURVES = """training,decisions,minutes,aoi,aoi_sem
turns-1,0.0,0.12,17.51,1.23
turns-1,4096.0,0.31,9.04,0.25
turns-1,8192.0,0.5,8.0,0.2
turns-2,0.0,0.2,99.0,9.0
local-1,0.0,0.1,30.0,2.0
local-1,4096.0,0.3,20.06,1.04
"""
TRAININGS = """training,commit,settings
turns-1,abc,"{""held_out"": 12}"
turns-2,other,"{""held_out"": 6}"
local-1,abc,"{""held_out"": 12}"
"""


@pytest.fixture
def trained(tmp_path):
    (tmp_path / "curves.csv").write_text(CURVES)
    (tmp_path / "trainings.csv").write_text(TRAININGS)
    return tmp_path


def test_two_runs_stand_side_by_side_by_their_decisions(trained):
    *table, empty, origin = program.table(trained, trained).splitlines()
    assert table == [
        "| team decisions | minutes | with turns | without turns |",
        "| --- | --- | --- | --- |",
        "| 0 | 0.1 | 17.5 ± 1.2 | 30.0 ± 2.0 |",
        "| 4,096 | 0.3 | 9.0 ± 0.2 | 20.1 ± 1.0 |",
        "| 8,192 | 0.5 | 8.0 ± 0.2 |  |",
    ]
    assert empty == ""
    assert "in 12 held-out missions" in origin
    assert "commit abc." in origin


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("curves.csv", "local-1", "local-3", "no run local-1"),
        ("trainings.csv", "local-1,abc", "local-1,def", "one commit"),
        ("trainings.csv", 'local-1,abc,"{""held_out"": 12', 'local-1,abc,"{""held_out"": 6', "one"),
    ],
)
def test_runs_that_cannot_be_compared_are_refused(trained, file, old, new, said):
    path = trained / file
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(ValueError, match=said):
        program.table(trained, trained)
