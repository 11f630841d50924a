"""Text, tables and the bar of long work on a terminal, and the names of programs."""

import math
import os
import shlex
import shutil
import sys
import time
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

BAR_WIDTH = 20
BETWEEN_COUNTS_S = 0.1  # as often as the bar is drawn; to count costs as much as a short window
SPEED_OVER_S = 600.0  # several rollouts of a training, and evaluations between them


def plain_console(*, is_error: bool = False) -> Console:
    """Return a terminal that shows text as it is: no colours, no broken lines, no markup."""
    return Console(stderr=is_error, highlight=False, soft_wrap=True, markup=False)


def say_written(path: Path, more: str = "") -> None:
    """Say on the terminal that a file was written, and how large it is or what it holds."""
    about = f": {more}" if more else ""
    plain_console().print(f"Wrote {shlex.quote(str(path))}{about}")


def is_notebook() -> bool:
    """Return whether this Python is the kernel of a notebook."""
    ipython = sys.modules.get("IPython")
    shell: Any = ipython.get_ipython() if ipython else None
    return hasattr(shell, "kernel")


def quiet_console() -> Console:
    """Return a terminal, if there is one: notebooks claim to be one, but keep every redrawing."""
    forced = False if is_notebook() else None
    return Console(stderr=True, highlight=False, force_jupyter=False, force_terminal=forced)


def num_cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):  # Linux
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def tell_cores(number: int, what: str = "jobs") -> None:
    """Say in one line if there are more jobs than cores to run them, or more threads."""
    cores = num_cores()
    if number > cores:
        others = f"those above {cores} cost memory and save no time"
        plain_console(is_error=True).print(f"{number} {what} share {cores} cores: {others}")


def named_values(title: str, rows: dict[str, str], caption: str | None = None) -> Table:
    """Return a table of values beside their names."""
    table = Table(title=title, title_justify="left", show_header=False)
    table.caption = caption
    table.caption_justify = "left"
    for name, value in rows.items():
        table.add_row(name, value)
    return table


def this_command(name: str = "swarm-mj") -> str:
    """Return how to call a program beside this Python: by name, or by path if it must be."""
    program = Path(sys.executable).with_name(name)
    found = shutil.which(name)
    if (found and Path(found) == program) or not program.exists():
        return name
    return os.path.relpath(program)


class WorkBar:
    """A bar on the terminal within a `with`, between `what` and `text`, which may both change."""

    def __init__(
        self,
        what: str,
        total: float | int,
        unit: str = "",
        *,
        completed: float | int = 0,
        console: Console | None = None,
        line_every_s: float = math.inf,
    ) -> None:
        """Prepare the bar, on standard error by default; without a unit, it shows no numbers.

        Where that is no terminal, a line tells the numbers, this often at most and only at an
        advance.
        """
        self.what = what
        self.text = ""
        console = console or Console(stderr=True, highlight=False)
        self._console = console
        self._unit = unit
        self._line_every_s = math.inf if console.is_terminal else line_every_s
        self._begun_s = 0.0
        self._line_s = 0.0  # when the last line was printed, or else the work begun
        count = f"{{task.completed:.0f}}/{{task.total:.0f}} {unit}"
        self._bar = Progress(
            TextColumn("{task.fields[bar].shown_what}", markup=False),
            BarColumn(BAR_WIDTH),
            *([TextColumn(count, markup=False)] if unit else []),
            TextColumn("{task.fields[bar].shown_text}", markup=False),
            TimeRemainingColumn(),
            console=console,
            speed_estimate_period=SPEED_OVER_S,
            transient=True,
            disable=not console.is_terminal,
        )
        self._id = self._bar.add_task("", total=total, completed=int(completed), bar=self)
        self._done = 0  # and not counted yet
        self._counted_text = ""  # what `text` was when work was last counted
        self._next_count_s = 0.0

    def __enter__(self) -> "WorkBar":
        self._begun_s = time.monotonic()
        self._line_s = self._begun_s
        self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._count()
        self._bar.stop()

    def advance(self, done: int = 1) -> None:
        """Count more work as done."""
        self._done += done
        now_s = time.monotonic()
        if now_s >= self._next_count_s:
            self._next_count_s = now_s + BETWEEN_COUNTS_S
            self._count()
        if now_s >= self._line_s + self._line_every_s:
            self._line_s = now_s
            self._count()
            self._print_line(now_s - self._begun_s)

    def _print_line(self, elapsed_s: float) -> None:
        [task] = self._bar.tasks
        numbers = f"{task.completed:.0f} of {task.total:.0f} {self._unit}"
        self._console.print(f"{self.what}: {numbers} after {elapsed_s:.0f} s", markup=False)

    def _count(self) -> None:
        self._bar.advance(self._id, self._done)
        self._done = 0
        self._counted_text = self.text

    @property
    def shown_text(self) -> str:
        """The text beside the bar, of the moment whose count it shows."""
        return self._counted_text if self._done > 0 else self.text

    def move_to(self, completed: float | int) -> None:
        """Set how much work is done in all."""
        self._done = 0
        self._bar.update(self._id, completed=completed)

    @property
    def shown_what(self) -> str:
        """The words before the bar, which are asked for at every redrawing."""
        return self.what
