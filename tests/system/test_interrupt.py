"""Ctrl-C noted first, obeyed at once the second time, and as ever afterwards."""

import signal
import sys
import threading
from contextlib import suppress

import pytest

from swarm_mj.system.interrupt import INTERRUPTS, deferred_interrupt, held_interrupts, interruptible


def test_the_first_ctrl_c_is_noted_and_the_second_interrupts():
    before = signal.getsignal(signal.SIGINT)
    with deferred_interrupt() as is_interrupted:
        assert not is_interrupted()
        signal.raise_signal(signal.SIGINT)
        assert is_interrupted()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) == before


@pytest.mark.parametrize("number", INTERRUPTS)
def test_a_shielded_job_stays_shielded(number):
    before = signal.signal(number, signal.SIG_IGN)
    try:
        with interruptible(), deferred_interrupt() as is_interrupted:
            signal.raise_signal(number)
            assert not is_interrupted()
        assert signal.getsignal(number) == signal.SIG_IGN
    finally:
        signal.signal(number, before)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_other_signals_are_ctrl_cs_but_a_hang_up_is_never_the_second(number):
    """A terminal that is closed sends several."""
    before = signal.getsignal(number)
    with pytest.raises(KeyboardInterrupt), interruptible():
        signal.raise_signal(number)
    with deferred_interrupt() as is_interrupted:
        signal.raise_signal(number)
        assert is_interrupted()
        signal.raise_signal(signal.SIGHUP)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
    assert signal.getsignal(number) == before


@pytest.mark.parametrize("number", INTERRUPTS)
def test_what_is_held_interrupts_at_the_end(number):
    before = signal.getsignal(number)
    done = []

    @held_interrupts()
    def work():
        signal.raise_signal(number)
        with held_interrupts():
            signal.raise_signal(number)
        done.append("all of it")

    with pytest.raises(KeyboardInterrupt), interruptible():
        work()
    assert done == ["all of it"]
    assert signal.getsignal(number) == before
    with deferred_interrupt() as is_interrupted:
        with held_interrupts():
            signal.raise_signal(signal.SIGINT)
            assert not is_interrupted()
        assert is_interrupted()


def test_another_thread_works_without_hearing():
    said = []

    def work():
        with interruptible(), deferred_interrupt() as is_interrupted, held_interrupts():
            said.append(is_interrupted())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert said == [False]


def test_a_handler_that_is_not_python_s_stays(monkeypatch):
    replaced = []
    monkeypatch.setattr(signal, "getsignal", lambda _: None)
    monkeypatch.setattr(signal, "signal", lambda *change: replaced.append(change))
    with interruptible(), deferred_interrupt():
        pass
    assert replaced == []


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_only_an_interrupt_that_cannot_be_raised_is_not_printed(monkeypatch, error):
    shown = []
    monkeypatch.setattr(sys, "unraisablehook", lambda unraised: shown.append(unraised.exc_type))

    class Fails:
        def __del__(self):
            raise error

    with interruptible():
        Fails()
    assert shown == ([] if error is KeyboardInterrupt else [error])
    Fails()
    assert shown[-1] is error


def test_an_interrupt_that_a_library_swallowed_is_not_lost():
    with interruptible():
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt), deferred_interrupt():
            raise AssertionError("the work has begun")
    with deferred_interrupt() as is_interrupted:  # of work that is not within it any more
        assert not is_interrupted()
