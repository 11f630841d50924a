"""Runs the command line as its users do."""

import pytest
from forks import files


@pytest.fixture
def swarm_mj(forks, tmp_path):
    """Runs `swarm-mj` in an empty folder; returns the finished process."""

    def run(*arguments):
        return forks.run(tmp_path, "swarm_mj", *arguments)

    return run


@pytest.fixture
def succeed(swarm_mj):
    """Runs `swarm-mj` likewise, with exit code 0."""

    def run(*arguments):
        done = swarm_mj(*arguments)
        assert done.returncode == 0, done.stdout + done.stderr
        return done

    return run


@pytest.fixture
def refusal(swarm_mj, tmp_path):
    """Runs what is refused, in one line, without a trace of work; returns the line."""

    def run(*arguments):
        before = files(tmp_path)
        done = swarm_mj(*arguments)
        assert (done.returncode, done.stdout) == (2, ""), done.stderr
        assert set(files(tmp_path)) <= set(before)
        (line,) = done.stderr.strip().splitlines()
        return line

    return run
