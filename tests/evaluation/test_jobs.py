"""Pieces of work on several processes: all done, failures told, nothing left behind."""

import multiprocessing
import os
import signal
import time

import pytest

from swarm_mj.evaluation.jobs import SURROUNDINGS, run_jobs
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


@pytest.mark.parametrize(("num_jobs", "num_pieces"), [(1, 7), (2, 7), (9, 3), (2, 0)])
def test_every_piece_is_done_once(num_jobs, num_pieces):
    done = dict(run_jobs(square, range(num_pieces), num_jobs))
    assert {index: product for index, (product, _) in done.items()} == {
        index: index**2 for index in range(num_pieces)
    }


def test_one_job_is_this_process():
    assert [pid for _, (_, pid) in run_jobs(square, range(3), 1)] == [os.getpid()] * 3


def test_two_jobs_work_at_the_same_time(tmp_path):
    a, b = tmp_path / "a", tmp_path / "b"
    pids = dict(run_jobs(patient, [(a, b), (b, a)], 2))
    assert len({os.getpid(), *pids.values()}) == 3


@pytest.mark.parametrize("num_jobs", [1, 2])
def test_a_failure_is_raised_here(num_jobs):
    with pytest.raises(ValueError, match="three is too many"):
        list(run_jobs(fail_at_3, range(6), num_jobs))
    assert multiprocessing.active_children() == []


@pytest.mark.parametrize("pieces", [[True, False], [False, True]])
def test_a_job_that_dies_is_noticed(pieces):
    with pytest.raises(OSError, match="ended from outside"):
        list(run_jobs(die_if, pieces, 2))


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
