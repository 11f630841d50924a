"""What every test runs under."""

import os
from pathlib import Path

import pytest
from forks import Forks
from hypothesis import settings
from sampled_types import check_again

# Compiling takes its time on an example's first run; no law here is about time.
settings.register_profile("all", deadline=None, max_examples=50)
settings.register_profile("fast", deadline=None, max_examples=20)

# What most commands load besides, seconds each. Tests of what a command loads have other processes.
LIBRARIES = (
    "pandas",  # of rerun
    "rerun.blueprint",
    "scipy.stats",
    "swarm_mj.api.charts",
    "swarm_mj.api.evaluate",
    "swarm_mj.api.fly",
    "swarm_mj.learning.train",
    "swarm_mj.replay.write",
    "torch._dynamo",  # of torch's optimisers
    "torch.utils.tensorboard",
)
TRAINING = Path(__file__).parent.parent / "training"


def stamps(folder):
    """When each file was last written, except for those in Python's and numba's caches."""
    files = (
        path for path in folder.rglob("*") if path.is_file() and path.parent.name != "__pycache__"
    )
    return {path: path.stat().st_mtime_ns for path in files}


@pytest.fixture(scope="session", autouse=True)
def _experiments_are_left_alone():
    """Fails the last test of a session that wrote under `training/`, where measured results are."""
    before = stamps(TRAINING)
    yield
    after = stamps(TRAINING)
    written = {path for path in before | after if before.get(path) != after.get(path)}
    assert not written, f"tests wrote {', '.join(map(str, sorted(written)))}"


@pytest.hookimpl(trylast=True)  # after the hook that has the types of all imported modules checked
def pytest_configure(config):
    """Decide once for all processes by what pictures are drawn, before a library chooses itself."""
    settings.load_profile("fast" if "not slow" in config.option.markexpr else "all")
    if not hasattr(config, "workerinput"):  # workers inherit it
        from swarm_mj.replay.rendering.opengl import CHOICE, backend

        try:
            backend()
        except OSError:
            os.environ[CHOICE] = "disable"


_checked_in = None  # the test, or the module of tests, in which types are checked


def pytest_runtest_setup(item):
    """Types are checked anew in every test; where slow tests are left out, in every module."""
    global _checked_in
    leaves_out_slow = "not slow" in item.config.option.markexpr
    checked_in = item.module if leaves_out_slow else item
    if checked_in is not _checked_in:
        _checked_in = checked_in
        check_again()


@pytest.fixture(scope="session")
def forks(tmp_path_factory):
    """Runs programs, each as a process of its own; all share what takes long to load."""
    programs = Forks(tmp_path_factory.mktemp("said"), LIBRARIES)
    yield programs
    programs.close()


@pytest.fixture(scope="session")
def opengl():
    """Skips the test where there is no OpenGL to draw pictures with."""
    from swarm_mj.replay.rendering.opengl import (
        make_context,  # types are checked in what is loaded later
    )

    try:
        make_context(8, 8).free()
    except OSError as error:
        pytest.skip(str(error))


TRAPPED = ("ctypes", "mujoco", "multiprocessing", "numpy", "pickle", "rerun_cli", "swarm_mj")


@pytest.fixture
def trapped(here):
    """A folder one stands in, whose modules nobody asked for; what they leave if they are run."""
    sprung = here / "sprung"
    for name in TRAPPED:
        (here / f"{name}.py").write_text(f"open({str(sprung)!r}, 'a').write('{name} ')\n")
    return sprung


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder, and this process in it."""
    monkeypatch.chdir(tmp_path)
    return tmp_path
