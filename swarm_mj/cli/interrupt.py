"""Ctrl-C as a wish that work honours at its next whole step."""

import signal
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from types import FrameType


def deferred_interrupt() -> AbstractContextManager[Callable[[], bool]]:
    """Within it the first Ctrl-C is only noted; a second one interrupts at once, as ever.

    It yields whether Ctrl-C was pressed.
    """
    return _noted(is_deferred=True)


def heard_interrupt() -> AbstractContextManager[Callable[[], bool]]:
    """Within it Ctrl-C interrupts at once, as ever, but is noted, should a library swallow it.

    An exception is lost if it comes while compiled code calls back into Python, as it does while
    numba loads kernels. It yields whether Ctrl-C was pressed.
    """
    return _noted(is_deferred=False)


@contextmanager
def _noted(*, is_deferred: bool) -> Iterator[Callable[[], bool]]:
    """Notes Ctrl-C; interrupts, too, unless it is the first and deferred."""
    was_pressed = False

    def note(signal_number: int, frame: FrameType | None) -> None:
        nonlocal was_pressed
        is_first, was_pressed = not was_pressed, True
        if not (is_first and is_deferred):
            signal.default_int_handler(signal_number, frame)

    before = signal.getsignal(signal.SIGINT)
    if before == signal.SIG_IGN:  # a job that its shell shields from Ctrl-C stays so
        yield lambda: False
        return
    signal.signal(signal.SIGINT, note)
    try:
        yield lambda: was_pressed
    finally:
        signal.signal(signal.SIGINT, before)
