"""Ctrl-C as a wish that work honours at its next whole step; SIGTERM and a hang-up are the same."""

import signal
import sys
import threading
from collections.abc import Callable, Container, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_pressed = [False]  # whether Ctrl-C was pressed within `interruptible`
# Windows knows no hang-up.
HANG_UP: signal.Signals | None = getattr(signal, "SIGHUP", None)
INTERRUPTS = tuple(each for each in (signal.SIGINT, signal.SIGTERM, HANG_UP) if each is not None)


def end_on_interrupt() -> None:
    """Let Ctrl-C end this process at once and silently, until `interruptible` hears it.

    Python would raise an exception, which some modules swallow while they load. A handler that a
    program has set stays, and so does a job's shield from Ctrl-C.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


@contextmanager
def interruptible() -> Iterator[Callable[[], bool]]:
    """Let SIGTERM and a hang-up within it interrupt as Ctrl-C does, if they would end the process.

    It yields whether one did, for a library may turn the exception into another.
    """
    _pressed[0] = False

    def interrupt(number: int, frame: FrameType | None) -> None:
        _pressed[0] = True
        signal.default_int_handler(number, frame)

    # Python prints what it cannot raise, in a callback or a `__del__`: this is heard all the same.
    show = sys.unraisablehook

    def show_others(unraised: "sys.UnraisableHookArgs") -> None:
        if not issubclass(unraised.exc_type, KeyboardInterrupt):
            show(unraised)

    sys.unraisablehook = show_others
    try:
        with _heard_by(interrupt, in_place_of=(signal.SIG_DFL, signal.default_int_handler)):
            yield lambda: _pressed[0]
    finally:
        sys.unraisablehook = show
        _pressed[0] = False


def raise_if_interrupted() -> None:
    """Raise KeyboardInterrupt if Ctrl-C was pressed within `interruptible`, and was swallowed.

    Modules do so that catch every exception while they load, and so do some libraries.
    """
    if _pressed[0]:
        raise KeyboardInterrupt


def answer_interrupt() -> None:
    """Take Ctrl-C as answered: it was the way to end this work, which is not broken off by it."""
    _pressed[0] = False


@contextmanager
def deferred_interrupt() -> Iterator[Callable[[], bool]]:
    """Only note the first Ctrl-C within it; a second one interrupts at once, as ever.

    It yields whether Ctrl-C was pressed. Raises KeyboardInterrupt at once if it was pressed before
    and a library swallowed that, as code may that runs while modules load.
    """
    raise_if_interrupted()
    was_pressed = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal was_pressed
        is_first = not was_pressed
        was_pressed = True
        # A terminal that is closed hangs up more than once, so a hang-up is never the second.
        if not is_first and number != HANG_UP:
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
def _heard_by(
    handler: Callable[[int, FrameType | None], object], in_place_of: Container[Any] | None = None
) -> Iterator[None]:
    """Replace the handlers of interrupts, as far as they can be put back."""
    # Only the main thread may do so, and a handler that is not Python's cannot be put back. One
    # that ignores a signal stays: a shell shields its job from Ctrl-C, `nohup` from hang-ups.
    is_main = threading.current_thread() is threading.main_thread()
    found = {number: signal.getsignal(number) for number in INTERRUPTS} if is_main else {}
    before = {
        number: each
        for number, each in found.items()
        if each not in (None, signal.SIG_IGN) and (in_place_of is None or each in in_place_of)
    }
    for number in before:
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number, each in before.items():
            signal.signal(number, each)
