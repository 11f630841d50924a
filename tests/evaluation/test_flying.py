"""Flights on several processes, all done once; and the file that gives them back bit for bit."""

import multiprocessing
import os
import signal
import time
from dataclasses import fields

import numpy as np
import pytest

from swarm_mj.evaluation.batch import BatchCosts
from swarm_mj.evaluation.flying import (
    SURROUNDINGS,
    append_progress,
    progress_path,
    resume_progress,
    run_jobs,
    start_progress,
)
from swarm_mj.system.interrupt import INTERRUPTS


def square(piece):
    return piece**2, os.getpid()


def patient(piece):
    """Waits for the file that another piece makes."""
    waits_for, makes = piece
    makes.touch()
    while not waits_for.exists():
        time.sleep(0.01)
    return os.getpid()


def fail_at_3(piece):
    if piece == 3:
        raise ValueError("three is too many")
    return piece


def die_if(piece):
    if piece:
        os.kill(os.getpid(), signal.SIGKILL)


def surroundings(_piece):
    for number in INTERRUPTS:
        signal.raise_signal(number)
    return {name: os.environ.get(name) for name in SURROUNDINGS}


def sleep(piece):
    time.sleep(piece)


@pytest.mark.parametrize(("num_jobs", "num_pieces"), [(1, 7), (9, 2), (2, 0)])
def test_every_piece_is_done_once_by_this_process_if_it_is_the_only_one(num_jobs, num_pieces):
    done = dict(run_jobs(square, range(num_pieces), num_jobs))
    products = {index: product for index, (product, _) in done.items()}
    assert products == {index: index**2 for index in range(num_pieces)}
    if num_jobs == 1:
        assert {pid for _, pid in done.values()} == {os.getpid()}


def test_two_jobs_work_at_the_same_time(tmp_path):
    a, b = tmp_path / "a", tmp_path / "b"
    pids = dict(run_jobs(patient, [(a, b), (b, a)], 2))
    assert len({os.getpid(), *pids.values()}) == 3


@pytest.mark.parametrize("num_jobs", [1, 2])
def test_a_failure_is_raised_here(num_jobs):
    with pytest.raises(ValueError, match="three is too many"):
        list(run_jobs(fail_at_3, range(6), num_jobs))
    assert multiprocessing.active_children() == []


def test_a_job_that_dies_is_noticed():
    with pytest.raises(OSError, match="ended from outside"):
        list(run_jobs(die_if, [False, True], 2))


def test_jobs_hear_no_ctrl_c_and_start_no_threads(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    before = dict(os.environ)
    found = [product for _, product in run_jobs(surroundings, range(2), 2)]
    assert found == [SURROUNDINGS] * 2
    assert signal.getsignal(signal.SIGINT) == signal.default_int_handler
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == set()
    assert dict(os.environ) == before


def test_breaking_off_ends_the_jobs_at_once():
    work = run_jobs(sleep, [0.0, 600.0, 600.0], 2)
    next(work)
    assert len(multiprocessing.active_children()) == 2
    work.close()
    assert multiprocessing.active_children() == []


def test_jobs_run_nothing_of_the_folder_here(trapped):
    assert sorted(product for _, (product, _) in run_jobs(square, [2, 3], 2)) == [4, 9]
    assert not trapped.exists()


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
