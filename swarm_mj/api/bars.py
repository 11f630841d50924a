"""Bars for Python: on a terminal, once the work takes its time; notebooks show none."""

from rich.console import Console

from swarm_mj.cli.progress import WorkBar

AFTER_S = 2.0  # shorter work shows no bar


def quiet_console() -> Console:
    """A terminal, if there is one."""
    return Console(stderr=True, highlight=False, force_jupyter=False)


def quiet_bar(what: str, total: int, unit: str) -> WorkBar:
    """A bar of this much work."""
    return WorkBar(what, total, unit, console=quiet_console(), after_s=AFTER_S)
