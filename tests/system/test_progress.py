"""The bar says what is under way and how far it is, and leaves nothing behind."""

import io
import sys
import time
from types import SimpleNamespace

import pytest
from rich.console import Console

from swarm_mj.system.progress import WorkBar, quiet_console


def shown(is_terminal, work):
    file = io.StringIO()
    console = Console(file=file, force_terminal=is_terminal, width=100, color_system=None)
    with WorkBar("Flying", 40, "missions", completed=10, console=console) as bar:
        work(bar)
        bar._bar.refresh()
    return file.getvalue()


def test_what_how_far_and_what_else_are_told():
    def work(bar):
        bar.advance(5)
        bar.text = "age 7.5"

    assert "Flying" in shown(True, work)
    assert "15/40 missions, age 7.5" in shown(True, work)


def test_work_may_be_told_in_all_and_change():
    def work(bar):
        bar.what = "Finishing"
        bar.move_to(40.0)

    drawn = shown(True, work)
    assert "Finishing" in drawn
    assert "40/40 missions" in drawn


def test_nothing_is_drawn_where_nobody_looks():
    assert shown(False, lambda bar: bar.advance()) == ""


def test_the_bar_is_gone_in_the_end_also_after_a_failure():
    """It ends with an erased line."""
    file = io.StringIO()
    console = Console(file=file, force_terminal=True, width=100)
    with pytest.raises(KeyboardInterrupt), WorkBar("Flying", 2, console=console):
        raise KeyboardInterrupt
    assert file.getvalue().endswith(("\x1b[2K", "\x1b[2K\r", "\x1b[?25h\r\x1b[1A\x1b[2K"))


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
