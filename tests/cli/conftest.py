"""Runs the command line as a process, as its users do."""

import subprocess
import sys

import pytest


@pytest.fixture
def swarm_mj(tmp_path):
    """Runs `swarm-mj` in an empty folder; returns the finished process."""

    def run(*arguments):
        command = [sys.executable, "-m", "swarm_mj", *map(str, arguments)]
        return subprocess.run(
            command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
        )

    return run
