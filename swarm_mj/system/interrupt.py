"""Ctrl-C as a wish that work honours at its next whole step; SIGTERM and a hang-up are the same."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

INTERRUPTS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def interruptible() -> Iterator[Callable[[], bool]]:
    """Let SIGTERM and a hang-up within it interrupt as Ctrl-C does, if they would end the process.

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


@contextmanager
def deferred_interrupt() -> Iterator[Callable[[], bool]]:
    """Only note the first Ctrl-C within it; a second one interrupts at once, as ever.

    It yields whether Ctrl-C was pressed.
    """
    was_pressed = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal was_pressed
        is_first, was_pressed = not was_pressed, True
        # A terminal that is closed hangs up more than once, so a hang-up is never the second.
        if not is_first and number != signal.SIGHUP:
            signal.default_int_handler(number, frame)

    with _heard_by(note):
        yield lambda: was_pressed


@contextmanager
def held_interrupts() -> Iterator[None]:
    """Let all interrupts within it wait until its end, for work that must not be broken off."""
    held: list[int] = []
    try:
        with _heard_by(lambda number, _: held.append(number)):
            yield
    finally:
        for number in held:
            signal.raise_signal(number)


@contextmanager
def _heard_by(handler: Callable[[int, FrameType | None], object]) -> Iterator[None]:
    # A job that its shell shields from Ctrl-C, or `nohup` from hang-ups, stays so.
    before = {number: each for number, each in _handlers().items() if each != signal.SIG_IGN}
    for number in before:
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number, each in before.items():
            signal.signal(number, each)


def _handlers() -> dict[signal.Signals, Any]:
    """Return the handlers of interrupts, as far as this thread may replace them and put them back.

    Only the main thread may, and a handler that is not Python's cannot be put back.
    """
    if threading.current_thread() is not threading.main_thread():
        return {}
    handlers = {number: signal.getsignal(number) for number in INTERRUPTS}
    return {number: handler for number, handler in handlers.items() if handler is not None}
