"""What a flight gives back, against plain loops over its windows and the files of the replay."""

import copy
import csv
import json
import pickle
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import swarm_mj
from swarm_mj.api.flight_summary import Metrics
from swarm_mj.replay import view
from swarm_mj.replay.read import windows
from swarm_mj.replay.view import VideoStyle

SHORT = {"num_robots": 6, "num_windows": 20, "range_ratio": 0.5}


@pytest.fixture(scope="module")
def run():
    return swarm_mj.fly("flocking", policy="tdma", seed=3, **SHORT)


@pytest.fixture(scope="module")
def unrecorded():
    return swarm_mj.fly("stationary", policy="mst", seed=3, record=False, **SHORT)


def test_the_table_has_a_row_per_window(run):
    table = run.to_dataframe()
    assert list(table.window) == list(range(1, 21))
    assert list(table.seconds) == pytest.approx([0.1 * window for window in range(1, 21)])
    assert table.aoi.mean() == pytest.approx(run.summary.aoi_mean)
    assert table.velocity_variance.iloc[0] == run.summary.velocity_variance_first
    assert table.velocity_variance.iloc[-1] == run.summary.velocity_variance_last
    assert table.packets_sent.sum() == run.summary.packets_sent == 40
    assert table.packets_delivered.isna().all()  # broadcasts have no addressee
    assert list(table.aoi_worst) == [matrix.max() for matrix in run.log.age]
    first = int(np.argmax(table.is_complete)) + 1
    assert first == run.summary.complete_window


def test_a_replay_is_saved_whole(run, tmp_path):
    assert run.save(str(tmp_path / "a.rrd")) == tmp_path / "a.rrd"
    assert list(windows(tmp_path / "a.rrd")) == list(range(1, 21))


def test_a_csv_has_the_table(run, tmp_path):
    table = run.to_dataframe()
    with run.save(tmp_path / "a.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == list(table.columns)
    assert [float(row["aoi"]) for row in rows] == list(table.aoi)
    assert rows[4]["window"] == "5"
    assert rows[4]["seconds"] == "0.5"
    assert rows[4]["packets_delivered"] == ""


def test_a_summary_is_saved_and_replaced(run, tmp_path):
    (tmp_path / "a.json").write_text("old")
    saved = json.loads(run.save(tmp_path / "a.json").read_text())
    assert saved["config"]["num_robots"] == 6
    assert saved["config"]["policy"] == "tdma"
    assert saved["aoi_mean"] == run.summary.aoi_mean


def test_other_endings_and_what_was_not_recorded_are_refused(run, unrecorded, tmp_path):
    endings = r"must be named \*.rrd or \*.mp4 or \*.gif or \*.json or \*.csv, not"
    with pytest.raises(ValueError, match=endings):
        run.save(tmp_path / "a.mp3")
    with pytest.raises(ValueError, match="fly with record=True"):
        unrecorded.save(tmp_path / "a.rrd")
    assert unrecorded.log is None
    assert "aoi_worst" not in unrecorded.to_dataframe()
    assert list(tmp_path.iterdir()) == []


def test_it_shows_itself_in_a_line_and_as_a_table(run):
    assert repr(run).startswith("<Run flocking, tdma, 6 robots, seed 3: age of information ")
    assert "\n" not in repr(run)
    html = run._repr_html_()
    assert html.count("<tr>") >= 8
    assert f"{run.summary.aoi_mean:.2f} windows" in html


TINY = {"num_robots": 4, "num_windows": 3, "range_ratio": 2.0}


@pytest.fixture
def small(monkeypatch):
    """Small pictures, of which there are few."""
    for suffix in (".mp4", ".gif"):
        monkeypatch.setitem(view.DEFAULTS, suffix, VideoStyle(width=320, height=200, fps=4))


@pytest.mark.usefixtures("opengl", "small")
@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_a_flight_is_saved_as_a_video(tmp_path, suffix):
    run = swarm_mj.fly("stationary", policy="tdma", **TINY)
    path = run.save(tmp_path / f"a{suffix}")
    header = {".mp4": (4, b"ftyp"), ".gif": (0, b"GIF89a")}
    at, magic = header[suffix]
    assert path.read_bytes()[at:].startswith(magic)


@pytest.mark.usefixtures("opengl", "small")
def test_a_notebook_plays_it(monkeypatch):
    shown = []
    monkeypatch.setattr("IPython.get_ipython", lambda: SimpleNamespace(kernel=None))
    monkeypatch.setattr("IPython.display.display", shown.append)
    swarm_mj.fly("stationary", policy="tdma", **TINY).show()
    (video,) = shown
    assert video.data[4:8] == b"ftyp"  # as every MP4 begins
    assert video.embed is True
    assert video.mimetype == "video/mp4"


def test_elsewhere_nothing_opens(run, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: None))
    run.show()
    assert "run.save('flight.mp4') writes the video" in capsys.readouterr().out


@pytest.mark.parametrize("is_notebook", [False, True])
def test_what_was_not_recorded_cannot_be_shown(is_notebook, unrecorded, monkeypatch):
    monkeypatch.setattr("swarm_mj.api.run.is_notebook", lambda: is_notebook)
    with pytest.raises(ValueError, match="fly with record=True"):
        unrecorded.show()


METRICS = Metrics({"aoi_mean": 10.123456789, "packets_lost": None, "of one": Metrics({"n": 3})})


def test_metrics_are_attributes_and_keys_copied_and_pickled():
    assert METRICS.aoi_mean == METRICS["aoi_mean"] == 10.123456789
    assert dict(METRICS) == {"aoi_mean": 10.123456789, "packets_lost": None, "of one": {"n": 3}}
    assert {"aoi_mean", "packets_lost"} <= set(dir(METRICS))
    assert pickle.loads(pickle.dumps(METRICS)) == copy.deepcopy(METRICS) == METRICS


def test_metrics_are_shown_a_line_each():
    assert repr(METRICS) == "aoi_mean      10.1235\npackets_lost  None\nof one\n  n  3"
    assert repr(Metrics({})) == ""


def test_a_slip_in_a_metrics_name_is_told_with_the_one_that_was_meant():
    with pytest.raises(AttributeError, match="there is no 'aoi_meen' here; did you mean aoi_mean"):
        _ = METRICS.aoi_meen
    assert not hasattr(METRICS, "nothing_like_it")
