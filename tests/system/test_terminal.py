"""Text is printed as it is, and programs are called as the reader can call them."""

import io
import sys

import pytest
from rich.console import Console

from swarm_mj.system import terminal
from swarm_mj.system.terminal import named_values, plain_console, this_command


@pytest.mark.parametrize("is_error", [False, True])
def test_text_is_shown_as_it_is(capsys, monkeypatch, is_error):
    """Markup, numbers and long lines included, also on a terminal with colours."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "40")
    text = "[bold]runs/x[/bold] 12.5 'y' " + 30 * "long "
    plain_console(is_error=is_error).print(text)
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == (("", text + "\n") if is_error else (text + "\n", ""))


def test_more_threads_than_cores_are_told(capsys, monkeypatch):
    monkeypatch.setattr(terminal, "num_cores", lambda: 2)
    terminal.tell_cores(2, "threads")
    assert capsys.readouterr().err == ""
    terminal.tell_cores(3, "threads")
    assert capsys.readouterr().err.startswith("3 threads share 2 cores: those above 2")


def test_values_stand_beside_their_names_under_the_title():
    shown = io.StringIO()
    table = named_values("A flight", {"age": "13.4", "hops": "1.2"}, caption="of all pairs")
    Console(file=shown, width=40).print(table)
    lines = [line.strip() for line in shown.getvalue().splitlines()]
    assert lines[0] == "A flight"
    assert [line.strip("│ ").split() for line in lines if "│" in line] == [
        ["age", "│", "13.4"],
        ["hops", "│", "1.2"],
    ]
    assert lines[-1] == "of all pairs"


@pytest.fixture
def programs(tmp_path, monkeypatch):
    """A Python and a program beside it, in `env/bin`, seen from `work`."""
    for name in ("env/bin/python", "env/bin/swarm-mj", "other/swarm-mj"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch(mode=0o755)
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    monkeypatch.setattr(sys, "executable", str(tmp_path / "env" / "bin" / "python"))
    return tmp_path


@pytest.mark.parametrize(
    ("on_path", "name", "called"),
    [
        ("env/bin", "swarm-mj", "swarm-mj"),
        ("nowhere", "swarm-mj", "../env/bin/swarm-mj"),
        ("other", "swarm-mj", "../env/bin/swarm-mj"),  # another of the same name
        ("nowhere", "python", "../env/bin/python"),
        ("nowhere", "tensorboard", "tensorboard"),  # there is none beside this Python
    ],
)
def test_a_program_is_called_by_name_if_that_is_the_one(
    programs, monkeypatch, on_path, name, called
):
    monkeypatch.setenv("PATH", str(programs / on_path))
    assert this_command(name) == called
