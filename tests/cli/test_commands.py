"""The command line without a command, and how commands end."""

import os
import signal
import time

from swarm_mj.cli import _exit_code
from swarm_mj.system.exit_codes import INTERRUPTED


def test_no_command_and_version(swarm_mj):
    assert swarm_mj().returncode == 2
    assert swarm_mj("--version").stdout.startswith("swarm-mj ")


def test_what_a_library_makes_of_an_interruption_is_one(capsys):
    """As matplotlib, which complains of a matrix that it could not finish."""

    def work():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(10.0)
        except KeyboardInterrupt:
            raise ValueError("a matrix") from None

    assert _exit_code("some", work) == INTERRUPTED
    assert capsys.readouterr().err == "some: interrupted\n"
