"""The file that gives flights back bit for bit."""

from dataclasses import fields

import numpy as np
import pytest

from swarm_mj.evaluation.batch import BatchCosts
from swarm_mj.evaluation.flying import (
    append_progress,
    progress_path,
    resume_progress,
    start_progress,
)

HEADER = {"commit": "abc", "seed": 1000, "policies": [{"policy": "mst", "probability": 0.06}]}


def some_costs(number):
    """Floats that text keeps only if it keeps all their digits, and what does not exist."""
    awkward = np.array([number, 0.1 + 0.2, 1e-300, 1.0 / 3.0, 1e22, 5e-324, np.nan])
    costs = {spec.name: awkward for spec in fields(BatchCosts)}
    return BatchCosts(**costs | {"ages": np.array([0, 3, 2**40])})


def assert_resumed(path, expected):
    """The batches that come back, by their indices, to the last bit."""
    found = resume_progress(path, HEADER)
    assert list(found) == list(expected)
    for index, costs in found.items():
        np.testing.assert_equal(vars(costs), vars(expected[index]))


def some_progress(path, *indices):
    start_progress(path, HEADER)
    for index in indices:
        append_progress(path, HEADER, index, some_costs(index / 7.0))
    return path


def test_what_was_appended_comes_back(tmp_path):
    path = some_progress(progress_path(tmp_path / "new" / "a.csv"), 3, 0)
    assert path == tmp_path / "new" / "a.csv.progress"
    assert_resumed(path, {3: some_costs(3 / 7.0), 0: some_costs(0.0)})
    assert len(path.read_bytes().splitlines()) == 3


@pytest.mark.parametrize("num_cut", [1, 20, 200])
def test_a_line_that_was_cut_off_is_dropped(tmp_path, num_cut):
    path = some_progress(tmp_path / "p", 0, 1)
    whole = path.read_bytes()
    path.write_bytes(whole[:-num_cut])
    assert_resumed(path, {0: some_costs(0.0)})
    append_progress(path, HEADER, 1, some_costs(1 / 7.0))
    assert path.read_bytes() == whole


@pytest.mark.parametrize("num_bytes", [0, 20])
def test_not_even_a_header_is_a_new_start(tmp_path, num_bytes):
    path = some_progress(tmp_path / "p")
    path.write_bytes(path.read_bytes()[:num_bytes])
    assert resume_progress(path, HEADER) == {}
    append_progress(path, HEADER, 4, some_costs(0.5))
    assert_resumed(path, {4: some_costs(0.5)})


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"commit": "def"}, "its commit is 'abc', not 'def'"),
        ({"commit": None}, "its commit is 'abc', not None"),
        ({"seed": 1}, "its seed is 1000, not 1"),
        ({"policies": []}, "it has 1 policies, not 0"),
        ({"policies": [{"policy": "mst", "probability": 0.1}]}, "its probability is 0.06, not 0.1"),
        ({"policies": [{"policy": "mst"}]}, "its probability is 0.06, not None"),
        ({"new": 1}, "its new is None, not 1"),
    ],
)
def test_another_evaluations_progress_is_refused_and_kept(tmp_path, changes, complaint):
    path = some_progress(tmp_path / "p", 0)
    before = path.read_bytes() + b'{"cut'
    path.write_bytes(before)
    with pytest.raises(ValueError, match=f"{complaint}; .* --force"):
        resume_progress(path, HEADER | changes)
    assert path.read_bytes() == before


@pytest.mark.parametrize("line", ["policy,task", '[1, {"aoi": []}]', "\xff", "another's"])
def test_damage_before_the_last_line_is_found(tmp_path, line):
    """As is a line of another evaluation, whose digest is right for another header."""
    path, other = some_progress(tmp_path / "p", 0), tmp_path / "other"
    added = line.encode("latin-1") + b"\n"
    if line == "another's":
        start_progress(other, HEADER | {"seed": 2000})
        append_progress(other, HEADER | {"seed": 2000}, 1, some_costs(0.5))
        added = other.read_bytes().splitlines(keepends=True)[1]
    for content in (path.read_bytes() + added, b"a text without a line that ends"):
        path.write_bytes(content)
        with pytest.raises(ValueError, match=r"is damaged, or of another version; .* --force"):
            resume_progress(path, HEADER)
        assert path.read_bytes() == content
