"""Ctrl-C as a wish that work honours at its next whole step; SIGTERM and a hang-up are the same."""

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from types import FrameType
from typing import Any

INTERRUPTS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def interruptible() -> Iterator[Callable[[], bool]]:
    """Within it SIGTERM and a hang-up interrupt as Ctrl-C does, if they would end the process.

    It yields whether one did, for a library may turn the exception into another.
    """
    was_interrupted = False

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal was_interrupted
        was_interrupted = True
        signal.default_int_handler(number, frame)

    usual = (signal.SIG_DFL, signal.default_int_handler)
    before = {number: handler for number, handler in _handlers().items() if handler in usual}
    for number in before:
        signal.signal(number, interrupt)
    try:
        yield lambda: was_interrupted
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def deferred_interrupt() -> AbstractContextManager[Callable[[], bool]]:
    """Within it the first Ctrl-C is only noted; a second one interrupts at once, as ever.

    It yields whether Ctrl-C was pressed.
    """
    return _noted(is_deferred=True)


def heard_interrupt() -> AbstractContextManager[Callable[[], bool]]:
    """Within it Ctrl-C interrupts at once, as ever, but is noted, should a library swallow it.

    An exception is lost if it comes while compiled code calls back into Python, as it does while
    numba loads kernels; Python then prints it, but not here. It yields whether Ctrl-C was pressed.
    """
    return _noted(is_deferred=False)


@contextmanager
def _noted(*, is_deferred: bool) -> Iterator[Callable[[], bool]]:
    """Note Ctrl-C; interrupts, too, unless it is the first and deferred.

    A terminal that is closed hangs up more than once, so a hang-up is never the second.
    """
    was_pressed = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal was_pressed
        is_first, was_pressed = not was_pressed, True
        if not (is_deferred and (is_first or number == signal.SIGHUP)):
            signal.default_int_handler(number, frame)

    # A job that its shell shields from Ctrl-C, or `nohup` from hang-ups, stays so.
    heard = {
        number: handler for number, handler in _handlers().items() if handler != signal.SIG_IGN
    }
    hook = sys.unraisablehook
    for number in heard:
        signal.signal(number, note)
    sys.unraisablehook = lambda lost: None if lost.exc_type is KeyboardInterrupt else hook(lost)
    try:
        yield lambda: was_pressed
    finally:
        sys.unraisablehook = hook
        for number, handler in heard.items():
            signal.signal(number, handler)


def _handlers() -> dict[signal.Signals, Any]:
    """Who hears what interrupts, as far as this thread may replace them and put them back.

    Only the main thread may; and nobody can put back a handler that is not Python's.
    """
    if threading.current_thread() is not threading.main_thread():
        return {}
    handlers = {number: signal.getsignal(number) for number in INTERRUPTS}
    return {number: handler for number, handler in handlers.items() if handler is not None}
