"""Files of weights: as they were saved, and refused where they are not."""

import json
import struct
import subprocess
import sys
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from residual_networks import WIDTH, some_weights
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from swarm_mj.policies.residual.network import Weights
from swarm_mj.policies.residual.stored import (
    METADATA,
    MOST_BYTES,
    is_residual,
    read_residual,
    save_residual,
)


@pytest.fixture
def path(tmp_path):
    """A sound policy."""
    save_residual(tmp_path / "mine.safetensors", some_weights(trust=2.5), "# Mine")
    return tmp_path / "mine.safetensors"


def refused(path, complaint):
    with pytest.raises(ValueError, match=complaint) as error:
        read_residual(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def about(path):
    """What the file says of its weights."""
    with safe_open(path, "np") as opened:
        return json.loads(opened.metadata()[METADATA])


def rewrite(path, *, arrays=None, **said):
    """Writes the file anew, with other arrays or another word of them."""
    document = json.dumps(about(path) | said)
    save_file(load_file(path) | (arrays or {}), path, {METADATA: document})


@pytest.mark.parametrize("corrects_turns", [False, True])
def test_a_network_comes_back_as_it_was(tmp_path, corrects_turns):
    weights = some_weights(trust=2.5, corrects_turns=corrects_turns)
    save_residual(tmp_path / "x.safetensors", weights, "# Mine")
    read = read_residual(tmp_path / "x.safetensors")
    assert (read.trust, read.corrects_turns, read.width) == (2.5, corrects_turns, WIDTH)
    assert read.arrays.keys() == weights.arrays.keys()
    for name, array in weights.arrays.items():
        np.testing.assert_array_equal(read.arrays[name], array)
        assert read.arrays[name].dtype == np.float32


def test_others_can_read_it_with_its_card(path):
    assert about(path) == {
        "format": "swarm_mj residual policy",
        "format_version": 1,
        "width": WIDTH,
        "trust": 2.5,
        "corrects_turns": False,
        "card": "# Mine",
    }
    assert load_file(path).keys() == some_weights().arrays.keys()
    assert [each.name for each in path.parent.iterdir()] == ["mine.safetensors"]


def test_arrays_in_another_order_of_memory_are_saved_as_they_are(path):
    weights = some_weights()
    turned = {name: np.asfortranarray(array) for name, array in weights.arrays.items()}
    save_residual(path, Weights(turned, 1.0, False), "")
    for name, array in weights.arrays.items():
        np.testing.assert_array_equal(read_residual(path).arrays[name], array)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (
            {"arrays": {"logit.bias": np.float32([np.nan])}},
            "logit.bias has numbers that are not fi",
        ),
        (
            {"arrays": {"logit.bias": np.float32([np.inf])}},
            "logit.bias has numbers that are not fi",
        ),
        (
            {"arrays": {"logit.bias": np.zeros(2, dtype=np.float32)}},
            r"tensor logit.bias must be \[1\] of float32, not \[2\] of float32",
        ),
        (
            {"arrays": {"logit.bias": np.zeros(1)}},
            r"must be \[1\] of float32, not \[1\] of float64",
        ),
        ({"arrays": {"more": np.zeros(1)}}, "it has an unknown tensor more"),
        ({"width": WIDTH + 1}, r"must be \[.*\] of float32, not"),
        ({"width": 0}, "its width must be from 1 to 256, not 0"),
        ({"width": 10**9}, "its width must be from 1 to 256, not 1000000000"),
        ({"width": "4"}, "Expected `int`"),
        ({"trust": None}, "Expected `float`"),
        ({"corrects_turns": 1}, "Expected `bool`"),
        ({"depth": 3}, "unknown field `depth`"),
        ({"format_version": 2}, "its format_version is 2, and this swarm_mj reads 1"),
        ({"format": "another"}, "its format must be .swarm_mj residual policy., not 'another'"),
    ],
)
def test_what_is_not_as_it_should_be_is_refused(path, change, complaint):
    rewrite(path, **change)
    refused(path, complaint)


def test_a_missing_array_is_refused(path):
    arrays = load_file(path)
    arrays.pop("logit.bias")
    save_file(arrays, path, {METADATA: json.dumps(about(path))})
    refused(path, "it lacks the tensor logit.bias; copy it again")


@pytest.mark.parametrize("kept", [0, 4, 8, 100, 0.5, 0.999])
def test_a_file_that_was_cut_off_is_refused(path, kept):
    data = path.read_bytes()
    path.write_bytes(data[: kept if isinstance(kept, int) else int(kept * len(data))])
    refused(path, "mine.safetensors: .*; copy it again")


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (b"PK\x03\x04 a pickle", "mine.safetensors: .*; copy it again"),
        (struct.pack("<Q", 2**63) + b"{}", "is no residual policy; name another file"),
        (struct.pack("<Q", 2**63) + b"[]", "Expected `object`, got `array`; copy it again"),
    ],
)
def test_files_of_other_kinds_are_refused(path, data, complaint):
    path.write_bytes(data)
    assert not is_residual(path)
    refused(path, complaint)


@pytest.mark.parametrize("metadata", [None, {"swarm_mj policy": "{}"}])
def test_weights_of_something_else_are_refused(path, metadata):
    save_file(load_file(path), path, metadata)
    assert not is_residual(path)
    refused(path, "is no residual policy; name another file")


@pytest.mark.parametrize("said", [[], 3, {METADATA: 3}, {METADATA: None}])
def test_metadata_that_is_no_text_is_refused(path, said):
    header = json.dumps({"__metadata__": said}).encode()
    path.write_bytes(struct.pack("<Q", len(header)) + header)
    assert not is_residual(path)
    refused(path, "Expected `.*; copy it again")


def test_no_file_and_a_folder_are_refused(tmp_path):
    assert not is_residual(tmp_path / "gone.safetensors")
    refused(tmp_path / "gone.safetensors", "there is no policy")
    (tmp_path / "x.safetensors").mkdir()
    assert not is_residual(tmp_path / "x.safetensors")
    refused(tmp_path / "x.safetensors", "is a folder, a pipe or a device; name a file")


def test_an_oversized_file_is_refused(path):
    """Sparse: it would take long to read, and is not read."""
    with path.open("r+b") as file:
        file.truncate(10**12)
    assert not is_residual(path)
    refused(path, f"may have up to {MOST_BYTES} bytes, not 1000000000000")


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda arrays: arrays["logit.bias"].fill(np.nan), "not finite"),
        (lambda arrays: arrays.update(more=np.zeros(1, dtype=np.float32)), "unknown tensor more"),
        (lambda arrays: arrays.update(more=np.zeros(2_000_000)), "may have up to 5000000 bytes"),
    ],
)
def test_what_could_not_be_read_is_not_saved(path, change, complaint):
    before, weights = path.read_bytes(), some_weights(seed=2)
    change(weights.arrays)
    with pytest.raises(ValueError, match=complaint):
        save_residual(path, weights, "")
    assert path.read_bytes() == before


def test_a_trust_that_is_no_number_is_not_saved(path):
    before = path.read_bytes()
    with pytest.raises(ValueError, match="JSON"):
        save_residual(path, some_weights(trust=np.inf), "")
    assert path.read_bytes() == before


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=150)
@given(data=st.data())
def test_any_damage_is_refused_or_harmless(path, data):
    """A byte changed anywhere: an error, or a network of finite numbers."""
    sound = path.read_bytes()
    place = data.draw(st.integers(0, len(sound) - 1))
    damaged = bytearray(sound)
    damaged[place] = data.draw(st.integers(0, 255))
    path.write_bytes(bytes(damaged))
    with suppress(ValueError):
        weights = read_residual(path)
        assert is_residual(path)
        assert weights.arrays.keys() == some_weights().arrays.keys()
        assert all(np.all(np.isfinite(array)) for array in weights.arrays.values())
    path.write_bytes(sound)


def test_flying_it_needs_no_torch(path):
    code = (
        "import sys; from swarm_mj.mission import paper; from swarm_mj.policies import make_policy;"
        f"make_policy({str(path)!r}, paper('stationary')); sys.exit('torch' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
