"""The command line, one file per command.

Exit codes: 0 done, 1 the machine failed, 2 bad input, 130 interrupted by Ctrl-C, SIGTERM or a
hang-up. A reader that closes the pipe, as `| head` does, and a terminal that is gone are no errors.
"""

import argparse
import importlib
import os
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

# All else is imported by functions that `main` calls, which hears Ctrl-C while modules load.
from swarm_mj.system.exit_codes import BAD_INPUT, DONE, FAILED, INTERRUPTED
from swarm_mj.system.interrupt import INTERRUPTS, interruptible, raise_if_interrupted
from swarm_mj.system.streams import in_a_line, lasting_streams

NAME = "swarm-mj"
WRONG_NAMES = (FileNotFoundError, IsADirectoryError, NotADirectoryError, PermissionError)
# Each is a module here: `fly` holds its options, `FlyOptions`, and its action, `run`. They are not
# imported for the overview, which has to be quick.
COMMANDS: dict[str, str] = {
    "fly": "Fly one mission and record its replay.",
    "policies": "List the communication policies: what each knows and sends.",
    "evaluate": "Compare policies on the same missions.",
    "check": "Check that flocks converge in time, by an exit code.",
    "study": "Fly a study that is a file, or compare two results.",
    "train": "Train a communication policy: a network, or an index.",
    "curves": "Show the learning curves of training runs.",
    "figures": "Draw the paper's figures from results.",
    "replay": "Open a replay in rerun's viewer, or make a video or a picture of it.",
    "export": "Write a replay as files of other tools: Foxglove, ns-3, tables.",
    "scene": "Write a mission's scene as MJCF, or fly it in MuJoCo's viewer.",
    "doctor": "Say what works on this machine, and how to mend what does not.",
    "bench": "Time the simulation and its parts.",
}
BEGINNING: dict[str, str] = {  # the overview's "begin with"
    "fly": "a flock of 40 robots flies 50 s; it records a replay",
    "replay FILE": "opens that replay",
    "policies": "what you can give to --policy, and what each one knows",
    "evaluate": "flies several policies on the same missions",
}


def parse(arguments: Sequence[str]) -> tuple[Any, Any]:
    """Return the function to run for the arguments, and its options; raise as `parse_options`."""
    if not arguments or arguments[0] not in COMMANDS:
        _show_or_refuse(arguments)
    from rich.console import Console

    from swarm_mj.cli.options import parse_options
    from swarm_mj.replay.rendering.opengl import chosen_backend

    name = arguments[0]
    chosen_backend()  # refuses a wrong name before something imports MuJoCo
    with Console(stderr=True).status("Loading ..."):
        command = importlib.import_module(f"swarm_mj.cli.{name}")
    kind = getattr(command, f"{name.title()}Options")
    return command.run, parse_options(kind, arguments[1:], f"{NAME} {name}", COMMANDS[name])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line, or this process's if none is given; return the exit code."""

    def work() -> int:
        run, options = parse(sys.argv[1:] if arguments is None else list(arguments))
        raise_if_interrupted()  # some of what was loaded may have swallowed it
        return run(options)

    return _exit_code(NAME, work)


def end_process() -> NoReturn:
    """Run this process's command line as `main` does, and end the process with its exit code."""
    code = main()
    for number in INTERRUPTS:  # the work is over: what comes now changes neither it nor the code
        signal.signal(number, signal.SIG_IGN)
    if code == INTERRUPTED:
        # Compiled code that was broken off while it loaded may crash when Python unloads its
        # libraries one by one, so an interrupted process ends at once.
        with suppress(OSError, ValueError):  # of streams that lead nowhere any more
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)
    sys.exit(code)


def script(
    kind: type[Any], run: Callable[[Any], int], arguments: Sequence[str] | None = None
) -> int:
    """Run a program such as those of `tools/`, by its options, as `main` runs a command."""
    from swarm_mj.cli.options import parse_options

    module = sys.modules[kind.__module__]
    name = Path(str(module.__file__)).stem
    typed = sys.argv[1:] if arguments is None else list(arguments)
    summary = str(module.__doc__).partition("\n")[0]
    return _exit_code(name, lambda: run(parse_options(kind, typed, name, summary)))


def _show_or_refuse(arguments: Sequence[str]) -> NoReturn:
    """Print the overview or the version, or refuse a line that names no command."""
    from swarm_mj.cli.options import Parser
    from swarm_mj.system.arguments import did_you_mean
    from swarm_mj.system.packages import version

    begin_with = {f"{NAME} {command}": meaning for command, meaning in BEGINNING.items()}
    parser = Parser(
        prog=NAME,
        usage=f"{NAME} COMMAND [OPTIONS]",
        description="Robot swarms on MuJoCo that share their state over a radio they compete for.",
        epilog=f"{_listed('commands', COMMANDS)}\n{_listed('begin with', begin_with)}\n"
        f"`{NAME} COMMAND --help` explains a command and its options.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"{NAME} {version()}")
    if not arguments:
        parser.print_help(sys.stderr)
        parser.exit(BAD_INPUT)
    if not arguments[0].startswith("-"):
        hint = did_you_mean(arguments[0], COMMANDS)
        parser.error(f"there is no command {arguments[0]!r}{hint}")
    parser.known(arguments)
    parser.error("name the command first")


def _listed(title: str, meanings: Mapping[str, str]) -> str:
    width = max(map(len, meanings))
    return f"{title}:\n" + "".join(f"  {each:{width}}  {meanings[each]}\n" for each in meanings)


def _exit_code(name: str, work: Callable[[], int]) -> int:
    """Do the work; print in one line what is wrong, or that it was interrupted."""
    with lasting_streams() as failure, interruptible() as was_interrupted:
        code, error = _outcome(work, was_interrupted)
        if error:
            sys.stderr.write(f"{name}: {in_a_line(error)}\n")
        if lost := failure():
            sys.stderr.write(f"{name}: error: not all output was written: {lost.strerror}\n")
        return code or (FAILED if lost else DONE)


def _outcome(work: Callable[[], int], was_interrupted: Callable[[], bool]) -> tuple[int, str]:
    """Return the exit code of some work, and the line to print of an error."""
    try:
        from swarm_mj.system.processes import safe_children
        from swarm_mj.system.user_code import one_line_each

        with one_line_each(), safe_children():
            code = work()
        raise_if_interrupted()  # work loads modules, too
        return code, ""
    except SystemExit as end:  # of help, or of a line that cannot be read
        return int(end.code or DONE), ""
    except Exception as error:
        if was_interrupted() and not isinstance(error, MemoryError):
            return INTERRUPTED, "interrupted"  # which a library made into another exception
        if not isinstance(error, (ValueError, OSError, ImportError, MemoryError, SystemError)):
            raise
        is_input = isinstance(error, (ValueError, *WRONG_NAMES))
        return BAD_INPUT if is_input else FAILED, f"error: {_said(error)}"
    except KeyboardInterrupt:
        return INTERRUPTED, "interrupted"


def _said(error: Exception) -> str:
    """Return an error's message; raise it again if it is a fault of this package's imports."""
    from swarm_mj.system.packages import missing

    if isinstance(error, MemoryError):
        return "this machine's memory does not suffice"
    if not isinstance(error, ImportError):
        return str(error)
    module = (error.name or "").partition(".")[0]
    if module == "swarm_mj" or not isinstance(error, ModuleNotFoundError):
        raise error
    return missing(module, "this") if str(error).startswith("No module named") else str(error)
