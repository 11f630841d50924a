"""Runs the command line as its users do."""

import pytest


@pytest.fixture
def swarm_mj(forks, tmp_path):
    """Runs `swarm-mj` in an empty folder; returns the finished process."""

    def run(*arguments):
        return forks.run(tmp_path, "swarm_mj", *arguments)

    return run
