"""Programs run as their users run them: as processes, without the type checks of these tests."""

import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

# Loading takes seconds and so does taking down what is loaded: it is done once for all programs.
FORK_FOR_EACH_LINE = """
import importlib, json, os, runpy, sys
from swarm_mj.cli import COMMANDS
for name in (*(f"swarm_mj.cli.{name}" for name in COMMANDS), *sys.argv[1:]):
    importlib.import_module(name)
for line in sys.stdin:
    folder, said, sys.argv = json.loads(line)
    child = os.fork()
    if child == 0:
        os.chdir(folder)
        for number, path in enumerate(said, start=1):
            os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        code = 0
        try:
            is_file = sys.argv[0].endswith(".py")
            if is_file:
                sys.path.insert(0, os.path.dirname(sys.argv[0]))  # as python does
            run = runpy.run_path if is_file else runpy.run_module
            run(sys.argv[0], run_name="__main__")
        except SystemExit as end:
            code = end.code
        sys.stdout.flush()
        os._exit(code)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


def files(folder):
    """The files in a folder and below it, by their names there; bytecode is Python's business."""
    found = (path for path in folder.rglob("*") if path.parent.name != "__pycache__")
    return sorted(str(path.relative_to(folder)) for path in found if path.is_file())


class Forks:
    """A process that has the package loaded, and forks itself for each program."""

    def __init__(self, folder, modules=()):
        """Keeps what programs say in the folder; loads more modules for all programs, by name."""
        self._said = [folder / "stdout", folder / "stderr"]
        self._process = subprocess.Popen(
            [sys.executable, "-c", FORK_FOR_EACH_LINE, *modules],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip

    def run(self, folder: Path, program, *arguments):
        """Runs a module by its name or a file by its path; returns the finished process."""
        line = [str(folder), [*map(str, self._said)], [*map(str, (program, *arguments))]]
        print(json.dumps(line), file=self._process.stdin, flush=True)
        code = int(self._process.stdout.readline())
        stdout, stderr = (path.read_text() for path in self._said)
        return SimpleNamespace(returncode=code, stdout=stdout, stderr=stderr)

    def close(self):
        """Ends the process."""
        self._process.communicate()
