"""Runs commands, and writes what memory each was to take, and took at its peak."""

import json
import os
import sys
from pathlib import Path

import swarm_mj.learning.train  # noqa: F401 - the estimate counts it with torch, which is loaded
from swarm_mj.cli import main
from swarm_mj.system.needs import peak_memory


def peak_of(arguments):
    """The needs of a command, as estimated, and its peak [bytes]."""
    estimated = []

    def keep(needs, *_, **__):
        estimated.append(needs)

    for name in ("fly", "evaluate", "train"):
        sys.modules[f"swarm_mj.cli.{name}"].check_fits = keep
    Path("/proc/self/clear_refs").write_text("5")  # the peak starts anew
    before = peak_memory()
    assert main(arguments) == 0, arguments
    return estimated[0].memory, peak_memory() - before, estimated[0].file


if __name__ == "__main__":
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    for index, line in enumerate(json.loads(Path("lines.json").read_text())):
        child = os.fork()  # what one command frees, the next would take
        if child == 0:
            Path(f"{index}.json").write_text(json.dumps(peak_of(line)))
            os._exit(0)
        assert os.waitpid(child, 0)[1] == 0, line
