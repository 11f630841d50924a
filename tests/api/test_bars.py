"""Long work shows a bar on a terminal, short work none, and notebooks never one."""

import io
import sys
import time
from types import SimpleNamespace

import pytest
from rich.console import Console

from swarm_mj.api.bars import quiet_console
from swarm_mj.system.progress import WorkBar


@pytest.mark.parametrize(("after_s", "is_shown"), [(0.01, True), (100.0, False)])
def test_a_bar_waits_for_work_that_takes_its_time(after_s, is_shown):
    file = io.StringIO()
    console = Console(file=file, force_terminal=True, width=100)
    with WorkBar("Flying", 2, console=console, after_s=after_s) as bar:
        bar.advance()
        for _ in range(1000):
            if "Flying" in file.getvalue() or not is_shown:
                break
            time.sleep(0.01)
    assert ("Flying" in file.getvalue()) == is_shown


def test_what_is_not_begun_leaves_nothing_behind():
    file = io.StringIO()
    console = Console(file=file, force_terminal=False, width=100)
    with pytest.raises(KeyboardInterrupt), WorkBar("Flying", 2, console=console, after_s=0.01):
        raise KeyboardInterrupt
    assert file.getvalue() == ""


def test_notebooks_which_claim_to_be_terminals_show_none(monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")  # as a notebook's server does
    assert quiet_console().is_terminal
    shell = SimpleNamespace(kernel=None)
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    assert not quiet_console().is_terminal
