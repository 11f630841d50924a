"""Ctrl-C as a wish that work honours at its next whole step."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def deferred_interrupt() -> Iterator[Callable[[], bool]]:
    """Within it the first Ctrl-C is only noted; a second one interrupts at once, as ever.

    Yields:
        Whether Ctrl-C was pressed.
    """
    was_pressed = False

    def note(signal_number: int, frame: FrameType | None) -> None:
        nonlocal was_pressed
        if was_pressed:
            signal.default_int_handler(signal_number, frame)
        was_pressed = True

    before = signal.getsignal(signal.SIGINT)
    if before == signal.SIG_IGN:  # a job that its shell shields from Ctrl-C stays so
        yield lambda: False
        return
    signal.signal(signal.SIGINT, note)
    try:
        yield lambda: was_pressed
    finally:
        signal.signal(signal.SIGINT, before)
