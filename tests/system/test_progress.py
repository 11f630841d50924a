"""The bar says what is under way and how far it is, and leaves nothing behind."""

import io

import pytest
from rich.console import Console

from swarm_mj.system.progress import WorkBar


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
