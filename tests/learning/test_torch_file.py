"""Files of tensors: sound ones are read, others are refused and run nothing."""

import pickle
import zipfile

import pytest
import torch

from swarm_mj.learning.torch_file import read_torch

STATE = {"weights": torch.arange(200.0), "at": 3, "names": ["one", "other"]}


@pytest.fixture
def kept(tmp_path):
    """A sound file."""
    torch.save(STATE, tmp_path / "c.pt")
    return tmp_path / "c.pt"


def refuse(path, complaint="is damaged, or none; begin a new run with another --out"):
    with pytest.raises(ValueError, match=complaint):
        read_torch(path, 100_000)


def test_a_sound_one_is_as_it_was_saved(kept):
    found = read_torch(kept, 100_000)
    assert torch.equal(found.pop("weights"), STATE["weights"])
    assert found == {"at": 3, "names": ["one", "other"]}


@pytest.mark.parametrize("share", [0.0, 0.5, 0.999])
def test_one_that_was_cut_off_is_refused(kept, share):
    content = kept.read_bytes()
    kept.write_bytes(content[: int(share * len(content))])
    refuse(kept)


def test_one_with_another_byte_among_its_numbers_is_refused(kept):
    content = bytearray(kept.read_bytes())
    content[content.index(STATE["weights"].numpy().tobytes()) + 100] ^= 1
    kept.write_bytes(content)
    refuse(kept)


def test_one_that_would_grow_when_it_is_read_is_refused(kept):
    with zipfile.ZipFile(kept) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(kept, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, part in parts.items():
            archive.writestr(name, part)
    refuse(kept)


def test_one_that_would_run_code_does_not(tmp_path):
    class Trap:
        def __reduce__(self):
            return (open, (str(tmp_path / "sprung"), "w"))

    torch.save({"policy": Trap()}, tmp_path / "c.pt")
    (tmp_path / "other.pt").write_bytes(pickle.dumps(Trap()))
    for name in ("c.pt", "other.pt"):
        refuse(tmp_path / name)
    assert not (tmp_path / "sprung").exists()


def test_one_that_is_too_large_missing_or_elsewhere_is_refused(kept, tmp_path):
    with pytest.raises(ValueError, match=r"c.pt may have up to 10 bytes, not \d+"):
        read_torch(kept, 10)
    refuse(tmp_path / "none.pt", "there is no checkpoint")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "c.pt").symlink_to(kept)
    refuse(tmp_path / "run" / "c.pt", "is a link that leads out of")
