"""A flight that is shown in pieces has the rows of the one that is drawn whole."""

import signal
import subprocess
import sys
from collections import defaultdict

import numpy as np
import pytest
from browsing import CHROMIUM, browser, page_of, share_of, until
from rerun.chunk import RrdReader

from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.replay import live, palette
from swarm_mj.replay.live import LiveReplay
from swarm_mj.replay.read import check_replay, read_footage
from swarm_mj.replay.recorder import Recorder
from swarm_mj.replay.write import write_replay
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm

CITY = {"arena": "blocks", "shadowing_db": 6.0, "velocity_ratio": 0.6}
FLIGHTS = {
    "addressed": ("mst", "flocking", {"boundary": "reflect"}),
    "broadcast": ("tdma", "flocking", {}),  # it agrees, in an open area
    "at rest": ("mst", "stationary", {}),
    "among obstacles": ("random-flooding", "random-walk", CITY),
    "with failures": ("tdma", "random-walk", {"failure_fraction": 0.3}),
}
CONFIG = {"policy": "a policy", "seed": 3, "packet_bytes": 100, "window_s": 0.1}


def flown(name, on_window=None, *, num_windows=90):
    """A recorder, and what `on_window` makes of it, called after every window."""
    policy, task, its = FLIGHTS[name]
    mission = paper(task, num_robots=9, num_windows=num_windows, **its)
    swarm = Swarm(mission, [3])
    swarm.start(make_policy(policy, mission))
    record = Recorder(swarm, ego=2)
    shown = on_window(record) if on_window else None
    for window in rollout(swarm):
        record.add(window)
        if shown:
            shown.show()
    return record, shown


@pytest.fixture
def nowhere(monkeypatch):
    """A viewer's address, to which nothing is sent."""
    monkeypatch.setattr(live.rr.RecordingStream, "connect_grpc", lambda *_: None)
    monkeypatch.setattr(live, "BETWEEN_PIECES_S", 0.0)
    return "rerun+http://127.0.0.1:9/proxy"


def rows(path):
    """By entity and component, the value of each window; of what never changes, the last."""
    found = defaultdict(list)
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if ":" in name or name in ("age", "is_on")]
        entity = chunk.entity_path
        if entity.startswith("/__properties"):
            continue
        for name in names:
            windows = [None] * batch.num_rows if chunk.is_static else batch["window"].to_pylist()
            for window, value in zip(windows, batch[name].to_pylist(), strict=True):
                found[entity, name].append((window, value))
    return {key: sorted(each, key=lambda row: row[0] or 0) for key, each in found.items()}


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_flight_shown_in_pieces_has_the_rows_of_the_whole_one(name, nowhere, tmp_path):
    def shows(record):
        return LiveReplay(record, CONFIG, "a", nowhere, has_file=True)

    record, shown = flown(name, shows)
    assert shown._num_drawn == 75  # three pieces of four, the last of which is not full
    shown.finish()
    shown.save(tmp_path / "pieces.rrd")
    check_replay(tmp_path / "pieces.rrd")
    write_replay(record.log(CONFIG), CONFIG, tmp_path / "a.rrd")
    pieces, whole = rows(tmp_path / "pieces.rrd"), rows(tmp_path / "a.rrd")
    assert pieces.keys() == whole.keys()
    for key, expected in whole.items():
        assert repr(pieces[key]) == repr(expected), key  # nan is not equal to itself
    seen, expected = (read_footage(tmp_path / f"{each}.rrd") for each in ("pieces", "a"))
    assert seen.facts == expected.facts
    np.testing.assert_array_equal(seen.position_m, expected.position_m)


@pytest.mark.parametrize(("between_s", "num_drawn"), [(0.0, 75), (1e9, 25)])
def test_pieces_are_whole_and_come_no_more_often_than_they_may(
    between_s, num_drawn, nowhere, monkeypatch
):
    """So that a fast flight is not held up: the rest is drawn in the end, in one piece."""
    monkeypatch.setattr(live, "BETWEEN_PIECES_S", between_s)
    _, shown = flown("addressed", lambda record: LiveReplay(record, CONFIG, "a", nowhere))
    assert shown._num_drawn == num_drawn
    shown.finish()
    assert shown._num_drawn == 90


def test_a_viewer_that_was_closed_ends_no_flight(nowhere, monkeypatch, tmp_path):
    def closed(*_, **__):
        raise RuntimeError("gRPC connection severed")

    _, shown = flown(
        "addressed", lambda record: LiveReplay(record, CONFIG, "a", nowhere, has_file=True)
    )
    monkeypatch.setattr(live.rr.RecordingStream, "flush", closed)
    shown.finish()
    monkeypatch.undo()
    shown.save(tmp_path / "a.rrd")
    assert len(read_footage(tmp_path / "a.rrd").window) == 90


def test_a_flight_without_a_window_is_nothing_to_show(nowhere):
    swarm = Swarm(paper(num_robots=4), [1])
    LiveReplay(Recorder(swarm), CONFIG, "a", nowhere).finish()


def test_a_piece_begins_with_a_snapshot_of_the_radio():
    """Every fourth window has one, so that pieces of 28 windows do."""
    swarm = Swarm(paper("random-walk", num_robots=4), [1])
    record = Recorder(swarm)
    assert record.piece_windows % record._radio_stride == 0
    record._radio_stride = 4
    assert record.piece_windows == 28


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="it needs Chromium")
def test_a_browser_shows_the_flight_while_it_goes_on_and_ctrl_c_keeps_it(tmp_path):
    """Our plots have a ground of their own; the map changes while the flight has not ended."""
    path = tmp_path / "a.rrd"
    flight = ("--policy", "tdma", "--windows", "100000", "--live", "web", "--speed", "4")
    command = [sys.executable, "-m", "swarm_mj", "fly", *flight, "--record", str(path)]
    with (tmp_path / "said.txt").open("w+") as said:
        flying = subprocess.Popen(command, stdout=said, stderr=said)
        try:
            address = until(lambda: page_of(said))
            with browser(address, tmp_path) as screenshot:
                until(lambda: share_of(palette.PLOT, screenshot()) > 0.1, limit_s=120.0)
                before = screenshot()
                until(lambda: np.mean(screenshot() != before) > 1e-3, limit_s=60.0)
            assert flying.poll() is None
            assert not path.exists()
        finally:
            flying.send_signal(signal.SIGINT)
            flying.wait(timeout=60)
    assert flying.returncode == 130
    assert len(read_footage(path).window) >= 25


def shows_a_curve(seen):
    """Its ground and a reference at once: the page draws one before the other."""
    return share_of(palette.PLOT, seen) > 0.05 and share_of(palette.REFERENCES[0], seen) > 1e-4


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="it needs Chromium")
def test_a_browser_shows_the_curve_and_the_mission_while_a_policy_trains(tmp_path):
    """The curve has its own colours, and the mission goes on between evaluations."""
    folder = tmp_path / "run"
    small = ("--robots", "8", "--task", "random-walk", "--windows", "200", "--latent", "4")
    limits = ("--evaluate-every", "20000", "--budget", "1000000000", "--live", "web")
    command = [sys.executable, "-m", "swarm_mj", "train", "--out", str(folder), *small, *limits]
    with (tmp_path / "said.txt").open("w+") as said:
        training = subprocess.Popen(command, stdout=said, stderr=said)
        try:
            address = until(lambda: page_of(said))
            with browser(address, tmp_path) as screenshot:
                until(lambda: shows_a_curve(screenshot()), limit_s=180.0)
                before = screenshot()
                until(lambda: np.mean(screenshot() != before) > 1e-3, limit_s=60.0)
            assert training.poll() is None
        finally:
            training.send_signal(signal.SIGINT)
            training.wait(timeout=120)
    assert training.returncode == 130
    assert (folder / "curve.csv").exists()
    assert (folder / "policy.safetensors").exists()
