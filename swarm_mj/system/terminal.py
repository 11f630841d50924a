"""The output of commands, and their names."""

import os
import shutil
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table


def plain_console(*, is_error: bool = False) -> Console:
    """Return a terminal that shows text as it is: no colours, no broken lines, no markup."""
    return Console(stderr=is_error, highlight=False, soft_wrap=True, markup=False)


def num_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def tell_cores(number: int, what: str = "jobs") -> None:
    """Say in one line if there are more jobs than cores to run them, or more threads."""
    cores = num_cores()
    if number > cores:
        plain_console(is_error=True).print(
            f"{number} {what} share {cores} cores: those above {cores} cost memory and save no time"
        )


def named_values(title: str, rows: dict[str, str], caption: str | None = None) -> Table:
    """Return a table of values beside their names."""
    table = Table(title=title, title_justify="left", show_header=False)
    table.caption, table.caption_justify = caption, "left"
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
