"""Engines do all pieces once, and end with whoever started them."""

import multiprocessing
import os
import signal
import time

import pytest

from swarm_mj.evaluation.engines import SURROUNDINGS, Local
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
    done = dict(Local(num_jobs=num_jobs).run(square, range(num_pieces)))
    products = {index: product for index, (product, _) in done.items()}
    assert products == {index: index**2 for index in range(num_pieces)}
    if num_jobs == 1:
        assert {pid for _, pid in done.values()} == {os.getpid()}


def test_two_jobs_work_at_the_same_time(tmp_path):
    a, b = tmp_path / "a", tmp_path / "b"
    pids = dict(Local(num_jobs=2).run(patient, [(a, b), (b, a)]))
    assert len({os.getpid(), *pids.values()}) == 3


@pytest.mark.parametrize("num_jobs", [1, 2])
def test_a_failure_is_raised_here(num_jobs):
    with pytest.raises(ValueError, match="three is too many"):
        list(Local(num_jobs=num_jobs).run(fail_at_3, range(6)))
    assert multiprocessing.active_children() == []


def test_a_job_that_dies_is_noticed():
    with pytest.raises(OSError, match="ended from outside"):
        list(Local(num_jobs=2).run(die_if, [False, True]))


def test_jobs_hear_no_ctrl_c_and_start_no_threads(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    before = dict(os.environ)
    found = [product for _, product in Local(num_jobs=2).run(surroundings, range(2))]
    assert found == [SURROUNDINGS] * 2
    assert signal.getsignal(signal.SIGINT) == signal.default_int_handler
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == set()
    assert dict(os.environ) == before


def test_breaking_off_ends_the_jobs_at_once():
    work = Local(num_jobs=2).run(sleep, [0.0, 600.0, 600.0])
    next(work)
    assert len(multiprocessing.active_children()) == 2
    work.close()
    assert multiprocessing.active_children() == []


def test_jobs_run_nothing_of_the_folder_here(trapped):
    assert sorted(product for _, (product, _) in Local(num_jobs=2).run(square, [2, 3])) == [4, 9]
    assert not trapped.exists()
