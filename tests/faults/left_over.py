"""What a program that was ended leaves running, by a mark in its environment that all inherit."""

import os
import signal
import socket
import time
from contextlib import suppress
from pathlib import Path

import pytest

MARK = "SWARM_MJ_TEST_MARK"
LIMIT_S = 3.0  # in which all must have ended
SLACK_S = 3.0  # for machines that are shared

needs_proc = pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="needs Linux")


def left_over(mark):
    """The processes with a mark, by their numbers."""
    found = {}
    for process in Path("/proc").glob("[0-9]*"):
        try:
            is_marked = f"{MARK}={mark}".encode() in (process / "environ").read_bytes().split(b"\0")
            if is_marked and (process / "stat").read_text().rpartition(")")[2].split()[0] != "Z":
                found[int(process.name)] = (process / "cmdline").read_bytes().replace(b"\0", b" ")
        except OSError:  # it has just ended
            continue
    return found


def after_limit(find):
    """What is found once all that ought to end has had its time."""
    deadline = time.monotonic() + LIMIT_S + SLACK_S
    while (found := find()) and time.monotonic() < deadline:
        time.sleep(0.05)
    return found


def left_after_limit(mark):
    """The processes with a mark that have not ended in time; ends them."""
    found = after_limit(lambda: left_over(mark))
    for number in found:
        with suppress(ProcessLookupError):
            os.kill(number, signal.SIGKILL)
    return found


def taken_after_limit(ports):
    """The ports of this machine that still cannot be listened on."""
    return after_limit(lambda: [port for port in ports if _is_taken(port)])


def _is_taken(port):
    with socket.socket() as listening:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listening.bind(("127.0.0.1", port))
        except OSError:
            return True
    return False


# Runs `swarm-mj`, or a program by its path, and sends it signals after some time.
SIGNALLED = f"""
import os, runpy, signal, sys, threading
if __name__ == "__main__":  # jobs import it
    mark, numbers, delay, ignored, program = sys.argv[1:6]
    os.environ["{MARK}"] = mark
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have had it ignored
    for number in map(int, ignored.split()):
        signal.signal(number, signal.SIG_IGN)
    def send():
        for number in map(int, numbers.split()):
            os.kill(os.getpid(), number)
    timer = threading.Timer(float(delay), send)
    timer.daemon = True
    timer.start()
    sys.argv = sys.argv[5:]
    run = runpy.run_path if program.endswith(".py") else runpy.run_module
    run(program, run_name="__main__")
"""


def signalled(forks, folder, numbers, delay_s, program, *arguments, ignored=()):
    """Runs a program that is sent signals; returns it, finished, and its mark."""
    script = folder.with_suffix(".py")
    script.write_text(SIGNALLED)
    mark = f"{os.getpid()}-{time.monotonic_ns()}"
    sent, kept_off = (" ".join(str(int(number)) for number in some) for some in (numbers, ignored))
    return forks.run(folder, script, mark, sent, delay_s, kept_off, program, *arguments), mark
