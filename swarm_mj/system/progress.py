"""The one bar of all long work: what is under way, how far it is, how long it will take."""

import sys
from threading import Timer
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

BAR_WIDTH = 20
AFTER_S = 2.0  # shorter work from Python shows no bar


class WorkBar:
    """A bar on the terminal while a `with` statement lasts; it leaves nothing behind.

    Attributes:
        what: The work under way.
        text: Words behind the bar.
    """

    def __init__(
        self,
        what: str,
        total: float | int,
        unit: str = "",
        *,
        completed: float | int = 0,
        console: Console | None = None,
        shows_time_left: bool = True,
        after_s: float = 0.0,
    ) -> None:
        """Prepare the bar, on standard error unless told otherwise.

        Without a unit, it shows no numbers; the time left is by the speed so far. Work that is done
        in less than `after_s` shows no bar [s].
        """
        self.what, self.text, self._unit = what, "", unit
        console = console or Console(stderr=True, highlight=False)
        self._bar = Progress(
            TextColumn("{task.fields[bar].shown_what}", markup=False),
            BarColumn(BAR_WIDTH),
            TextColumn("{task.fields[bar].shown_text}", markup=False),
            *([TimeRemainingColumn()] if shows_time_left else []),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
        self._timer = Timer(after_s, self._bar.start)
        self._timer.daemon = True
        self._id = self._bar.add_task("", total=total, completed=int(completed), bar=self)

    def __enter__(self) -> "WorkBar":
        if self._timer.interval > 0.0 and not self._bar.disable:
            self._timer.start()
        else:
            self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._timer.cancel()
        if self._timer.is_alive():
            self._timer.join()
        self._bar.stop()

    def advance(self, done: int = 1) -> None:
        """Count more work as done."""
        self._bar.advance(self._id, done)

    def move_to(self, completed: float | int) -> None:
        """Set how much work is done in all."""
        self._bar.update(self._id, completed=completed)

    @property
    def shown_what(self) -> str:
        """The words before the bar, as they are drawn now."""
        return self.what

    @property
    def shown_text(self) -> str:
        """The count and the words behind the bar, as they are drawn now."""
        task = self._bar.tasks[0]
        count = f"{task.completed:.0f}/{task.total:.0f} {self._unit}" if self._unit else ""
        return ", ".join(filter(None, (count, self.text)))


def is_notebook() -> bool:
    """Return whether this Python is the kernel of a notebook."""
    ipython = sys.modules.get("IPython")
    shell: Any = ipython.get_ipython() if ipython else None
    return hasattr(shell, "kernel")


def quiet_console() -> Console:
    """Return a terminal, if there is one: notebooks claim to be one, but keep every redrawing."""
    forced = False if is_notebook() else None
    return Console(stderr=True, highlight=False, force_jupyter=False, force_terminal=forced)


def quiet_bar(what: str, total: int, unit: str) -> WorkBar:
    """Return a bar for Python: on a terminal, once the work takes its time."""
    return WorkBar(what, total, unit, console=quiet_console(), after_s=AFTER_S)
