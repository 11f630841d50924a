"""Ctrl-C noted first, obeyed at once the second time, and as ever afterwards."""

import contextlib
import ctypes
import signal
import sys
import threading

import pytest

from swarm_mj.system.interrupt import INTERRUPTS, deferred_interrupt, heard_interrupt, interruptible


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
def test_other_signals_are_ctrl_cs(number):
    before = signal.getsignal(number)
    with pytest.raises(KeyboardInterrupt), interruptible():
        signal.raise_signal(number)
    with deferred_interrupt() as is_interrupted:
        signal.raise_signal(number)
        assert is_interrupted()
    assert signal.getsignal(number) == before


def test_a_hang_up_is_never_the_second():
    """A terminal that is closed sends several."""
    with deferred_interrupt():
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGHUP)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)


def test_a_ctrl_c_that_is_heard_interrupts_at_once():
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), heard_interrupt():
        signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) == before


def test_a_ctrl_c_that_a_library_swallowed_is_not_lost():
    with heard_interrupt() as was_pressed:
        assert not was_pressed()
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        assert was_pressed()


def test_what_a_callback_swallowed_is_noted_and_not_printed(monkeypatch):
    printed = []
    monkeypatch.setattr(sys, "unraisablehook", printed.append)

    @ctypes.CFUNCTYPE(None, ctypes.py_object)
    def called_back(failure):
        raise failure

    with heard_interrupt():
        called_back(KeyboardInterrupt())
        assert printed == []
        called_back(KeyError())
    assert [lost.exc_type for lost in printed] == [KeyError]


def test_another_thread_works_without_hearing():
    said = []

    def work():
        with interruptible(), deferred_interrupt() as is_interrupted, heard_interrupt():
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
