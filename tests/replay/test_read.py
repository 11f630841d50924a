"""Whole replays pass, others are refused with their reason."""

import json
import shutil

import numpy as np
import pytest

from swarm_mj.replay.read import check_replay, windows


def test_windows_are_the_flight_s(replay, two_way):
    np.testing.assert_array_equal(windows(replay), two_way.log.window)


def test_a_truncated_replay_is_refused(replay, tmp_path):
    broken = tmp_path / "broken.rrd"
    broken.write_bytes(replay.read_bytes()[: replay.stat().st_size // 2])
    with pytest.raises(ValueError, match="truncated, or not an"):
        check_replay(broken)


def test_a_file_that_is_no_replay_is_refused(tmp_path):
    other = tmp_path / "other.rrd"
    other.write_text(json.dumps({"not": "a replay"}))
    with pytest.raises(ValueError, match="truncated, or not an"):
        check_replay(other)
    with pytest.raises(ValueError, match="there is no replay"):
        check_replay(tmp_path / "missing.rrd")


def test_a_recording_of_something_else_shows_no_robots(tmp_path):
    import rerun as rr

    path = tmp_path / "else.rrd"
    with rr.RecordingStream("other") as recording:
        recording.save(path)
        recording.log("thing", rr.TextLog("hello"))
    check_replay(path)
    with pytest.raises(ValueError, match="no replay of swarm_mj"):
        windows(path)


def test_a_copy_is_as_good(replay, tmp_path):
    copy = tmp_path / "copy.rrd"
    shutil.copy(replay, copy)
    check_replay(copy)
