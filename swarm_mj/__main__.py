"""`swarm-mj`, which is `python -m swarm_mj`, too."""

from typing import NoReturn

from swarm_mj.system.interrupt import end_on_interrupt


def run() -> NoReturn:
    """Run this process's command line, and end the process with its exit code."""
    # First of all: the command line takes a moment to load, and nothing can be lost yet.
    end_on_interrupt()
    from swarm_mj.cli import end_process

    end_process()


if __name__ == "__main__":
    run()
