"""Whole replays pass, others are refused with their reason; rerun passes over the digest."""

import hashlib
import warnings

import numpy as np
import pytest
from rerun.chunk import RrdReader

from swarm_mj.replay.read import (
    SEAL_BYTES,
    check_replay,
    read_footage,
    windows,
    with_digest,
)
from swarm_mj.replay.write import write_replay


def refuse(path):
    with pytest.raises(ValueError, match="no whole replay"):
        check_replay(path)


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


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("a b.rrd", r"`rerun '/.*a b\.rrd'`"),  # can be pasted
        ("fading.py", r"fading.py is no whole replay: .* record it again by `swarm-mj fly`"),
        ("missing.rrd", "cannot be found"),
    ],
)
def test_a_complaint_names_the_file_and_the_way_out(tmp_path, name, complaint):
    if "missing" not in name:
        (tmp_path / name).write_bytes(b"{}")
    with pytest.raises(ValueError, match=complaint):
        check_replay(tmp_path / name)


def test_a_replay_without_facts_is_refused_in_one_line(two_way, tmp_path, monkeypatch):
    monkeypatch.setattr("swarm_mj.replay.write.FACTS", "other")
    write_replay(two_way.log, {"seed": 5}, tmp_path / "old.rrd")
    with pytest.raises(ValueError, match=r"old\.rrd does not hold .*; record it again"):
        read_footage(tmp_path / "old.rrd")


@pytest.fixture
def bare(replay, tmp_path):
    """The replay as rerun wrote it."""
    path = tmp_path / "bare.rrd"
    path.write_bytes(replay.read_bytes()[:-SEAL_BYTES])
    return path


def test_it_is_the_sha256_of_what_rerun_wrote(replay, bare):
    assert hashlib.sha256(bare.read_bytes()).digest() in replay.read_bytes()[-SEAL_BYTES:]
    refuse(bare)
    assert with_digest(bare.read_bytes()) == replay.read_bytes()


def test_rerun_reads_the_same(replay, bare):
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # such as of a footer that is not found
        ours, theirs = RrdReader(replay), RrdReader(bare)
        assert ours.store().summary() == theirs.store().summary()
        assert len(ours.blueprints()) == len(theirs.blueprints()) == 1


def test_every_byte_counts(replay, tmp_path):
    """Those of the digest itself, of the first block, and of what is between."""
    whole = bytearray(replay.read_bytes())
    places = [*range(200), *range(len(whole) - SEAL_BYTES - 200, len(whole))]
    for place in [*places, *range(200, len(whole), 9973)]:
        whole[place] ^= 1
        (tmp_path / "other.rrd").write_bytes(whole)
        refuse(tmp_path / "other.rrd")
        whole[place] ^= 1


@pytest.mark.parametrize("num_bytes", [0, 11, 100])
def test_what_rerun_did_not_write_to_its_end_gets_none(bare, num_bytes):
    bare.write_bytes(bare.read_bytes()[:num_bytes])
    with pytest.raises(OSError, match=r"did not record .* to its end"):
        with_digest(bare.read_bytes())
    refuse(bare)
