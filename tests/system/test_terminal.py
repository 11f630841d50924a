"""Text is printed as it is, programs are named as they can be called, and the bar is true."""

import io
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from rich.console import Console

from swarm_mj.system import terminal
from swarm_mj.system.terminal import WorkBar, plain_console, this_command


@pytest.mark.parametrize("is_error", [False, True])
def test_text_is_shown_as_it_is(capsys, monkeypatch, is_error):
    """Markup, numbers and long lines included, also on a terminal with colours."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "40")
    text = "[bold]runs/x[/bold] 12.5 'y' " + 30 * "long "
    plain_console(is_error=is_error).print(text)
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == (("", text + "\n") if is_error else (text + "\n", ""))


def test_a_written_file_is_named_as_a_shell_reads_it(capsys):
    terminal.say_written(Path("a b.csv"))
    terminal.say_written(Path("c.mcap"), "12 kB")
    assert capsys.readouterr().out == "Wrote 'a b.csv'\nWrote c.mcap: 12 kB\n"


def test_more_threads_than_cores_are_told(capsys, monkeypatch):
    monkeypatch.setattr(terminal, "num_cores", lambda: 2)
    terminal.tell_cores(2, "threads")
    assert capsys.readouterr().err == ""
    terminal.tell_cores(3, "threads")
    assert capsys.readouterr().err.startswith("3 threads share 2 cores: those above 2")


@pytest.mark.parametrize(
    ("on_path", "name", "called"),
    [
        ("env/bin", "swarm-mj", "swarm-mj"),
        ("nowhere", "swarm-mj", "../env/bin/swarm-mj"),
        ("other", "swarm-mj", "../env/bin/swarm-mj"),  # another of the same name
        ("nowhere", "tensorboard", "tensorboard"),  # there is none beside this Python
    ],
)
def test_a_program_is_called_by_name_if_that_is_the_one(
    tmp_path, monkeypatch, on_path, name, called
):
    """A Python and a program beside it, in `env/bin`, seen from `work`."""
    for program in ("env/bin/python", "env/bin/swarm-mj", "other/swarm-mj", "work/none"):
        (tmp_path / program).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / program).touch(mode=0o755)
    monkeypatch.chdir(tmp_path / "work")
    monkeypatch.setattr(sys, "executable", str(tmp_path / "env" / "bin" / "python"))
    monkeypatch.setenv("PATH", str(tmp_path / on_path))
    assert this_command(name) == called


def bar_on(is_terminal=True):
    """A bar, and what it draws."""
    file = io.StringIO()
    console = Console(file=file, force_terminal=is_terminal, width=100, color_system=None)
    return WorkBar("Flying", 40, "missions", completed=10, console=console), file


def test_the_bar_says_what_is_under_way_and_how_far_it_is():
    bar, file = bar_on()
    with bar:
        bar.advance(5)
        bar.text = "age 7.5"
        bar._bar.refresh()
        assert "Flying" in file.getvalue()
        assert "15/40 missions age 7.5" in file.getvalue()
        bar.what = "Finishing"
        bar.move_to(40.0)
        bar._bar.refresh()
    assert "Finishing" in file.getvalue()
    assert "40/40 missions" in file.getvalue()


def test_the_bar_is_gone_in_the_end_also_after_a_failure():
    """It ends with an erased line."""
    bar, file = bar_on()
    with pytest.raises(KeyboardInterrupt), bar:
        raise KeyboardInterrupt
    assert file.getvalue().endswith(("\x1b[2K", "\x1b[2K\r", "\x1b[?25h\r\x1b[1A\x1b[2K"))


def test_nothing_is_drawn_where_nobody_looks():
    bar, file = bar_on(is_terminal=False)
    with pytest.raises(KeyboardInterrupt), bar:
        raise KeyboardInterrupt
    assert file.getvalue() == ""


def test_where_no_bar_is_drawn_a_line_now_and_then_says_how_far_it_is(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(terminal.time, "monotonic", lambda: clock[0])
    for is_terminal in (False, True):
        file = io.StringIO()
        console = Console(file=file, force_terminal=is_terminal, color_system=None)
        clock[0] = 100.0
        bar = WorkBar("Flying", 90, "missions", completed=10, console=console, line_every_s=30.0)
        with bar:
            for clock[0] in (110.0, 129.0, 131.0, 132.0, 160.0, 161.5):
                bar.advance(10)
        lines = [line for line in file.getvalue().splitlines() if line.startswith("Flying: ")]
        expected = [
            "Flying: 40 of 90 missions after 31 s",
            "Flying: 70 of 90 missions after 62 s",
        ]
        assert lines == ([] if is_terminal else expected)


def test_notebooks_which_claim_to_be_terminals_show_none(monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")  # as a notebook's server does
    assert terminal.quiet_console().is_terminal
    shell = SimpleNamespace(kernel=None)
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    assert not terminal.quiet_console().is_terminal


def test_the_bar_counts_a_burst_of_work_at_its_end_and_a_tenth_of_a_second_later(monkeypatch):
    """Each count takes as long as a short window does."""
    clock = iter([0.0, 1.0, 1.05, 1.09, 1.11])
    monkeypatch.setattr(terminal.time, "monotonic", lambda: next(clock, 2.0))
    bar, _ = bar_on()
    bar._next_count_s = 0.5
    counted = []
    for _ in range(5):
        bar.advance()
        counted.append(bar._bar.tasks[0].completed - 10)
    assert counted == [0, 2, 2, 2, 5]
    bar.advance()
    with bar:
        bar.advance()
    assert bar._bar.tasks[0].completed == 17


def test_the_text_is_of_the_moment_whose_count_is_shown(monkeypatch):
    """A burst of work is not counted at once, and neither is what it says."""
    now_s = [0.0]
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now_s[0])
    with WorkBar("Flying", 10.0, "windows", console=Console(file=io.StringIO())) as bar:
        for age in ("0.5", "1.0", "1.5"):
            bar.text = f"age {age}"
            bar.advance()
        assert bar.shown_text == "age 0.5"
        now_s[0] = 1.0
        bar.text = "age 2.0"
        bar.advance()
        assert bar.shown_text == "age 2.0"
