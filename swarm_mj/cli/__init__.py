"""The command line, one file per command.

`swarm-mj fly | evaluate | train | figures | replay | scene | policies | doctor | bench`.

Exit codes: 0 done, 1 the machine failed, 2 bad input, 130 interrupted by Ctrl-C, SIGTERM or a
hang-up. A reader that closes the pipe, as `| head` does, and a terminal that is gone are no errors.
"""

import importlib
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from swarm_mj.mission.components import one_line_each
from swarm_mj.system.exit_codes import BAD_INPUT, DONE, FAILED, INTERRUPTED
from swarm_mj.system.interrupt import interruptible
from swarm_mj.system.streams import lasting_streams

Options = TypeVar("Options")

WRONG_NAMES = (FileNotFoundError, IsADirectoryError, NotADirectoryError, PermissionError)
COMMANDS = {  # each a module here, with its options, `Options`, and what it does, `run`
    "fly": "Fly one mission and record its replay.",
    "policies": "List the communication policies: what each knows and sends.",
    "evaluate": "Fly policies over the same missions and say where they stand.",
    "train": "Train a communication policy by PPO.",
    "figures": "Draw the paper's figures from results.",
    "replay": "Open a replay in rerun's viewer, or make a video of it.",
    "scene": "Write the scene of a mission as one MJCF file.",
    "doctor": "Say what works on this machine, and how to mend what does not.",
    "bench": "Time the simulation and its parts.",
}


def parse(arguments: Sequence[str]) -> tuple[Any, Any]:
    """What was typed after `swarm-mj` asks for: a command's `run`, and the options to call it with.

    It imports the command here, so that Ctrl-C is heard while modules load.

    Raises:
        ValueError: A value is unknown or outside its range.
        SystemExit: The line cannot be read, or only help was asked for.
    """
    if arguments and arguments[0] in COMMANDS:
        from rich.console import Console

        from swarm_mj.cli import options
        from swarm_mj.replay.rendering.opengl import check_choice

        check_choice()  # before something imports MuJoCo
        with Console(stderr=True).status("Loading ..."):
            command = importlib.import_module(f"swarm_mj.cli.{arguments[0]}")
        prog, summary = f"swarm-mj {arguments[0]}", COMMANDS[arguments[0]]
        return command.run, options.parse(command.Options, arguments[1:], prog, summary)
    from swarm_mj.cli.overview import show_or_refuse

    show_or_refuse(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line, or this process's if none is given; returns the exit code."""

    def work() -> int:
        run, options = parse(sys.argv[1:] if arguments is None else list(arguments))
        return run(options)

    return _exit_code("swarm-mj", work)


def end_process() -> NoReturn:
    """Run this process's command line as `main` does, and ends the process with its exit code.

    It ends at once when it was interrupted: compiled code that was broken off while it loaded may
    crash if Python then takes its libraries down one by one.
    """
    code = main()
    if code == INTERRUPTED:
        with suppress(OSError, ValueError):  # of streams that lead nowhere any more
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)
    sys.exit(code)


def script(
    kind: type[Options], run: Callable[[Options], int], arguments: Sequence[str] | None = None
) -> int:
    """Run a program of its own, such as those of `tools/`, as `main` does a command.

    Args:
        kind: The dataclass of its options; its module's docstring says what it does.
        run: What to do with them; it returns the exit code.
        arguments: What was typed after the program's name; None is this process's.
    """
    from swarm_mj.cli import options

    module = sys.modules[kind.__module__]
    name = Path(str(module.__file__)).stem
    typed = sys.argv[1:] if arguments is None else list(arguments)
    summary = str(module.__doc__).partition("\n")[0]
    return _exit_code(name, lambda: run(options.parse(kind, typed, name, summary)))


def _exit_code(name: str, work: Callable[[], int]) -> int:
    """Do the work; says in one line what is wrong, or that it was interrupted."""
    with lasting_streams() as failure, interruptible() as was_interrupted:
        code = _told(name, work, was_interrupted)
        if lost := failure():
            sys.stderr.write(f"{name}: error: not all output was written: {lost.strerror}\n")
        return code or (FAILED if lost else DONE)


def _told(name: str, work: Callable[[], int], was_interrupted: Callable[[], bool]) -> int:
    try:
        try:
            with one_line_each():
                return work()
        except (
            ValueError,
            OSError,
            ImportError,
        ) as error:  # perhaps what a library made of a Ctrl-C
            if was_interrupted():
                raise KeyboardInterrupt from error
            raise
    except SystemExit as end:  # of help, or of a line that cannot be read
        return int(end.code or DONE)
    except (ValueError, OSError) as error:
        sys.stderr.write(f"{name}: error: {error}\n")
        return BAD_INPUT if isinstance(error, (ValueError, *WRONG_NAMES)) else FAILED
    except ModuleNotFoundError as error:
        sys.stderr.write(f"{name}: error: {_missing(error)}\n")
        return FAILED
    except MemoryError:
        sys.stderr.write(f"{name}: error: this machine's memory does not suffice\n")
        return FAILED
    except KeyboardInterrupt:
        sys.stderr.write(f"{name}: interrupted\n")
        return INTERRUPTED


def _missing(error: ModuleNotFoundError) -> str:
    """What to say of a package that is not installed; raises the error again if it is our own."""
    from swarm_mj.system.packages import missing

    module = (error.name or "").partition(".")[0]
    if module == "swarm_mj":
        raise error
    return missing(module, "this") if str(error).startswith("No module named") else str(error)
