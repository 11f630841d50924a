"""Whole replays pass, others are refused with their reason."""

import shutil

import numpy as np
import pytest

from swarm_mj.replay.read import check_replay, windows


def test_windows_are_the_flight_s(replay, two_way):
    np.testing.assert_array_equal(windows(replay), two_way.log.window)


@pytest.mark.parametrize(
    "change", [lambda b: b[: len(b) // 2], lambda b: b + b"!", lambda _: b"{}"]
)
def test_what_is_no_whole_replay_is_refused(replay, tmp_path, change):
    other = tmp_path / "other.rrd"
    other.write_bytes(change(replay.read_bytes()))
    with pytest.raises(ValueError, match=r"damaged, truncated, or not recorded by this version"):
        check_replay(other)


def test_the_command_named_can_be_pasted(tmp_path):
    (tmp_path / "a b.rrd").write_bytes(b"{}")
    with pytest.raises(ValueError, match=r"`rerun '/.*a b\.rrd'`"):
        check_replay(tmp_path / "a b.rrd")


def test_no_replay_is_no_crash(tmp_path):
    with pytest.raises(ValueError, match="there is no replay"):
        check_replay(tmp_path / "missing.rrd")


def test_a_copy_is_as_good(replay, tmp_path):
    copy = tmp_path / "copy.rrd"
    shutil.copy(replay, copy)
    check_replay(copy)
