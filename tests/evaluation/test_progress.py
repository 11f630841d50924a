"""The progress file: what was appended comes back bit for bit, and nothing else does."""

import json

import pytest

from swarm_mj.evaluation import progress
from swarm_mj.evaluation.batch import BatchCosts

HEADER = {"commit": "abc", "seed": 1000, "policies": [{"policy": "mst", "probability": 0.06}]}


def some_costs(number):
    return BatchCosts(
        aoi=[number, 0.1 + 0.2],
        aoi_steady=[1e-300, 2.0],
        aoi_floor=[0.0, 1.0 / 3.0],
        velocity_variance=[1e22, 5e-324],
        hops=[1.0, 2.0],
        task_cost=[None, 0.5],
        task_cost_last=[None, 1e9],
        complete_window=[None, 7],
        packets_sent=[1, 2],
        packets_transmitted=[1, 3],
        packets_delivered=[0, None],
        packets_heard=[None, 2],
        packets_receptions=[None, 5],
        ages=[0, 3, 2**40],
    )


def some_progress(path, *indices):
    progress.start(path, HEADER)
    for index in indices:
        progress.append(path, HEADER, index, some_costs(index / 7.0))
    return path


def test_it_stands_beside_the_output(tmp_path):
    assert progress.progress_path(tmp_path / "a.csv") == tmp_path / "a.csv.progress"


def test_what_was_appended_comes_back(tmp_path):
    path = some_progress(tmp_path / "new" / "p", 3, 0)
    assert progress.resume(path, HEADER) == {3: some_costs(3 / 7.0), 0: some_costs(0.0)}
    assert len(path.read_bytes().splitlines()) == 3


@pytest.mark.parametrize("num_cut", [1, 20, 200])
def test_a_line_that_was_cut_off_is_dropped(tmp_path, num_cut):
    path = some_progress(tmp_path / "p", 0, 1)
    whole = path.read_bytes()
    path.write_bytes(whole[:-num_cut])
    assert progress.resume(path, HEADER) == {0: some_costs(0.0)}
    progress.append(path, HEADER, 1, some_costs(1 / 7.0))
    assert path.read_bytes() == whole


@pytest.mark.parametrize("num_bytes", [0, 20])
def test_not_even_a_header_is_a_new_start(tmp_path, num_bytes):
    path = some_progress(tmp_path / "p")
    path.write_bytes(path.read_bytes()[:num_bytes])
    assert progress.resume(path, HEADER) == {}
    progress.append(path, HEADER, 4, some_costs(0.5))
    assert progress.resume(path, HEADER) == {4: some_costs(0.5)}


def test_starting_replaces_what_was_there(tmp_path):
    path = some_progress(tmp_path / "p", 0, 1)
    progress.start(path, HEADER)
    assert progress.resume(path, HEADER) == {}


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
        progress.resume(path, HEADER | changes)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "line", ["policy,task", "[]", "{}", '{"batch": 1, "costs": {"aoi": []}}', "\xff", "another's"]
)
def test_damage_before_the_last_line_is_found(tmp_path, line):
    """As is a line of another evaluation, whose digest is right for another header."""
    path, other = some_progress(tmp_path / "p", 0), tmp_path / "other"
    added = line.encode("latin-1") + b"\n"
    if line == "another's":
        progress.start(other, HEADER | {"seed": 2000})
        progress.append(other, HEADER | {"seed": 2000}, 1, some_costs(0.5))
        added = other.read_bytes().splitlines(keepends=True)[1]
    path.write_bytes(path.read_bytes() + added)
    with pytest.raises(ValueError, match=r"is damaged, or of another version; start .* --force"):
        progress.resume(path, HEADER)


def test_a_text_that_is_none_is_not_replaced(tmp_path):
    """Even if it has no line that ends."""
    (tmp_path / "p").write_text("my thesis")
    with pytest.raises(ValueError, match="is damaged"):
        progress.resume(tmp_path / "p", HEADER)
    assert (tmp_path / "p").read_text() == "my thesis"


def test_numbers_that_are_none_never_get_in(tmp_path):
    path = some_progress(tmp_path / "p")
    with pytest.raises(ValueError, match="not JSON compliant"):
        progress.append(path, HEADER, 0, some_costs(float("nan")))
    assert [json.loads(line.partition(" ")[2]) for line in path.read_text().splitlines()] == [
        HEADER
    ]
