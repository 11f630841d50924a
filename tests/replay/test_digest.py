"""The digest tells every change of a replay, and rerun reads the file as if it were not there."""

import hashlib
import warnings

import pytest
from rerun.chunk import RrdReader

from swarm_mj.replay.digest import SEAL_BYTES, has_digest, with_digest


@pytest.fixture
def bare(replay, tmp_path):
    """The replay as rerun wrote it."""
    path = tmp_path / "bare.rrd"
    path.write_bytes(replay.read_bytes()[:-SEAL_BYTES])
    return path


def test_it_is_the_sha256_of_what_rerun_wrote(replay, bare):
    assert hashlib.sha256(bare.read_bytes()).digest() in replay.read_bytes()[-SEAL_BYTES:]
    assert not has_digest(bare)
    assert with_digest(bare.read_bytes()) == replay.read_bytes()


def test_rerun_reads_the_same(replay, bare):
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # such as of a footer that is not found
        ours, theirs = RrdReader(replay), RrdReader(bare)
        assert ours.store().summary() == theirs.store().summary()
        assert len(ours.blueprints()) == len(theirs.blueprints()) == 1


def test_every_byte_counts(replay, tmp_path):
    """Those of the digest itself, of the first block, and of what is between."""
    whole, path = bytearray(replay.read_bytes()), tmp_path / "a.rrd"
    places = [*range(200), *range(len(whole) - SEAL_BYTES - 200, len(whole))]
    for place in [*places, *range(200, len(whole), 9973)]:
        whole[place] ^= 1
        path.write_bytes(whole)
        whole[place] ^= 1
        assert not has_digest(path), place


@pytest.mark.parametrize("num_bytes", [0, 11, 100])
def test_what_rerun_did_not_write_to_its_end_gets_none(bare, num_bytes):
    bare.write_bytes(bare.read_bytes()[:num_bytes])
    with pytest.raises(OSError, match=r"did not record .* to its end"):
        with_digest(bare.read_bytes())
    assert not has_digest(bare)
