"""Bars for Python: on a terminal, once the work takes its time; notebooks show none."""

import sys
from typing import Any

from rich.console import Console

from swarm_mj.system.progress import WorkBar

AFTER_S = 2.0  # shorter work shows no bar


def is_notebook() -> bool:
    """Whether this Python is the kernel of a notebook."""
    ipython = sys.modules.get("IPython")
    shell: Any = ipython.get_ipython() if ipython else None
    return hasattr(shell, "kernel")


def quiet_console() -> Console:
    """A terminal, if there is one; notebooks, which claim to be one, would keep every redrawing."""
    forced = False if is_notebook() else None
    return Console(stderr=True, highlight=False, force_jupyter=False, force_terminal=forced)


def quiet_bar(what: str, total: int, unit: str) -> WorkBar:
    """Return a bar of this much work."""
    return WorkBar(what, total, unit, console=quiet_console(), after_s=AFTER_S)
