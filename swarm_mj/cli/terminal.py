"""What commands print, and how they name themselves."""

import io
import os
import shutil
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table


def open_streams() -> None:
    """Makes standard streams take whatever is printed, on any terminal, or on none.

    Characters that a terminal does not know become `?`. Streams that were closed lead nowhere:
    files opened later would else take their numbers, and with them what libraries complain of.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115 - for good
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def plain_console(*, is_error: bool = False) -> Console:
    """A terminal that shows text as it is: no colours of its own, no broken lines, no markup."""
    return Console(stderr=is_error, highlight=False, soft_wrap=True, markup=False)


def named_values(title: str, rows: dict[str, str], caption: str | None = None) -> Table:
    """A table of values beside their names."""
    table = Table(title=title, title_justify="left", show_header=False)
    table.caption, table.caption_justify = caption, "left"
    for name, value in rows.items():
        table.add_row(name, value)
    return table


def this_command(name: str = "swarm-mj") -> str:
    """How the reader can call a program beside this Python: by name, or by path if it must be."""
    program = Path(sys.executable).with_name(name)
    found = shutil.which(name)
    if (found and Path(found) == program) or not program.exists():
        return name
    return os.path.relpath(program)
