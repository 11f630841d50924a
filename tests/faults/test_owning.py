"""Whatever a program starts ends with it, however the program ends, and sends nothing anywhere."""

import json
import random
import re
import signal
import socket
import sys
import threading
import urllib.request
from pathlib import Path

import pytest
from damage import ROOT
from left_over import left_after_limit, needs_proc, signalled, taken_after_limit

from swarm_mj.replay.view import quiet_environment, serve_command
from swarm_mj.system.processes import running

ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)
HAS_VULKAN = any(Path("/usr/share/vulkan/icd.d").glob("*.json"))

# Two processes that compute for half a minute without letting another thread of theirs run.
BUSY = '''"""Computes."""
import sys
from dataclasses import dataclass
from swarm_mj.cli import script
from swarm_mj.evaluation.engines import Local
@dataclass
class Options:
    pass
def busy(piece):
    return sum(range(10**9))
if __name__ == "__main__":
    sys.exit(script(Options, lambda _: len(list(Local(num_jobs=2).run(busy, [1, 2])))))
'''

# The same, killed in the moment in which its processes have begun and none has a guard.
KILLED = BUSY.replace(
    "    sys.exit(",
    """    import os, signal
    from contextlib import contextmanager
    from swarm_mj.evaluation import engines
    def watch(_):
        os.kill(os.getpid(), signal.SIGKILL)
    @contextmanager
    def guard():
        yield watch
    engines.guard = guard
    sys.exit(""",
)
# The same, whose guard takes nobody.
REFUSED = KILLED.replace("os.kill(os.getpid(), signal.SIGKILL)", "raise OSError('no guard')")


@pytest.fixture(scope="module")
def replay(forks, tmp_path_factory):
    folder = tmp_path_factory.mktemp("replay")
    flown = forks.run(
        folder, "swarm_mj", "fly", "--robots", 5, "--windows", 20, "--record", "a.rrd"
    )
    assert flown.returncode == 0, flown.stderr
    return folder / "a.rrd"


@pytest.fixture
def ended(forks, tmp_path, tries):
    """Runs a program that is ended at random moments; nothing of it is left running."""

    def runs(usual, end, between_s, *program):
        rng = random.Random(end)
        # A signal in the first moment, before anything has begun, ends a process as usual.
        codes = {-end} if end == signal.SIGKILL else {0, 130, -end}
        for _ in range(tries(usual)):
            done, mark = signalled(forks, tmp_path, [end], rng.uniform(*between_s), *program)
            assert done.returncode in codes, done.stderr
            assert left_after_limit(mark) == {}
            assert "Traceback" not in done.stderr
            yield done

    return runs


@pytest.mark.slow
@needs_proc
@pytest.mark.fault("orphans of killed programs")
@pytest.mark.parametrize("end", ENDS)
def test_jobs_that_compute_end_with_their_parent(ended, tmp_path, end):
    """Fault 6."""
    (tmp_path / "busy.py").write_text(BUSY)
    assert all(done.returncode for done in ended(2, end, (0.0, 1.0), tmp_path / "busy.py"))


@pytest.mark.slow
@needs_proc
@pytest.mark.fault("orphans of killed programs")
def test_jobs_begin_with_nothing_before_they_are_guarded(forks, tmp_path):
    (tmp_path / "busy.py").write_text(KILLED)
    done, mark = signalled(forks, tmp_path, [], 60.0, tmp_path / "busy.py")
    assert done.returncode == -signal.SIGKILL
    assert left_after_limit(mark) == {}


@pytest.mark.slow
@needs_proc
@pytest.mark.fault("orphans of killed programs")
def test_jobs_that_cannot_be_guarded_are_not_waited_for(forks, tmp_path):
    """They wait at a gate that nobody will open: after a minute, it is killed."""
    (tmp_path / "busy.py").write_text(REFUSED)
    done, mark = signalled(forks, tmp_path, [signal.SIGKILL], 60.0, tmp_path / "busy.py")
    assert done.returncode > 0
    assert "no guard" in done.stderr
    assert left_after_limit(mark) == {}


@pytest.mark.slow
@needs_proc
@pytest.mark.fault("orphans of killed programs")
def test_an_evaluation_s_jobs_end_with_it(ended):
    """Fault 6, as it was found."""
    jobs = ("--policy", "planner", "tdma", "--jobs", 2, "--episodes", 1000)
    assert list(ended(1, signal.SIGKILL, (0.1, 4.0), "swarm_mj", "evaluate", *jobs))


@pytest.mark.slow
@needs_proc
@pytest.mark.fault("orphans of killed programs")
@pytest.mark.parametrize("end", ENDS)
def test_the_server_of_a_replay_ends_with_it(ended, replay, end):
    """Fault 5: and its ports are free again."""
    for done in ended(1, end, (0.0, 2.0), "swarm_mj", "replay", "--web", replay):
        ports = re.findall(r"127\.0\.0\.1(?::|%3A)(\d+)", done.stdout)
        assert taken_after_limit([*map(int, ports)]) == []


@needs_proc
@pytest.mark.skipif(not HAS_VULKAN, reason="no Vulkan driver on this machine")
@pytest.mark.fault("orphans of killed programs")
def test_a_picture_s_viewer_ends_with_it(ended, replay, tmp_path):
    """Fault 5, of tools/picture.py."""
    assert list(ended(1, signal.SIGKILL, (2.0, 6.0), ROOT / "tools" / "picture.py", replay))
    assert not (tmp_path / "replay.png").exists()


@pytest.fixture
def asked():
    """A proxy that refuses all: yields its address, and what it has been asked for."""
    lines = []
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve():
            while True:
                try:
                    connection = server.accept()[0]
                except OSError:
                    return
                with connection:
                    lines.append(connection.recv(4096).split(b"\r\n")[0].decode())

        threading.Thread(target=serve, daemon=True).start()
        yield f"http://127.0.0.1:{server.getsockname()[1]}", lines
        server.shutdown(socket.SHUT_RDWR)


@pytest.mark.slow
@pytest.mark.fault("telemetry of dependencies")
def test_a_server_tells_nobody_that_it_is_used(replay, tmp_path, monkeypatch, asked):
    """Fault 4: it would, to a user who has run rerun before, once its page is opened."""
    proxy, lines = asked
    monkeypatch.setenv("FORCE_RERUN_ANALYTICS", "1")
    config = tmp_path / "rerun" / "analytics.json"
    config.parent.mkdir()
    paths = {"config_file_path": str(config), "data_dir_path": str(tmp_path / "data")}
    config.write_text(json.dumps({"analytics_enabled": True, "analytics_id": "0", **paths}))
    command, address = serve_command(replay)
    environment = quiet_environment() | {"XDG_CONFIG_HOME": str(tmp_path), "ALL_PROXY": proxy}
    with running(command, environment=environment) as server:
        wait_for(address)
        with urllib.request.urlopen(address.partition("?")[0] + "re_viewer_bg.wasm") as page:
            assert page.status == 200
        with pytest.raises(Exception, match="timed out"):
            server.wait(timeout=4.0)  # it sends every other second
    assert lines == []


def wait_for(address):
    """Waits until a page is served."""
    for _ in range(600):
        try:
            urllib.request.urlopen(address).close()
            return
        except OSError:
            threading.Event().wait(0.05)
    raise AssertionError(f"nothing is served at {address}")


@pytest.mark.fault("jobs beyond the machine")
@pytest.mark.parametrize(
    ("program", "arguments"),
    [
        ("swarm_mj", ("evaluate",)),
        ("swarm_mj", ("bench", "--episodes", 0)),
        ("tools/reference_policy.py", ("weights.npz",)),
        ("training/results.py", ()),
    ],
)
def test_no_program_takes_0_jobs(forks, tmp_path, program, arguments):
    """Fault 20: it was unchecked where nothing was left to do."""
    path = ROOT / program if program.endswith(".py") else program
    done = forks.run(tmp_path, path, *arguments, "--jobs", 0)
    assert done.returncode == 2
    assert done.stderr.strip().endswith("jobs must be a whole number from 1 to 256, not 0")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.fault("jobs beyond the machine")
def test_more_jobs_than_cores_are_told(forks, tmp_path):
    """Fault 8: 256 jobs on two cores."""
    small = ("--policy", "tdma", "--robots", 5, "--windows", 5, "--episodes", 1)
    done = forks.run(tmp_path, "swarm_mj", "evaluate", *small, "--jobs", 256)
    assert done.returncode == 0, done.stderr
    (told,) = [line for line in done.stderr.splitlines() if "cores" in line]
    assert told.startswith("256 jobs share ")
    assert sys.platform != "linux" or "cost memory and save no time" in told
