"""Runs that go on: from what is theirs, or not at all, and one process at a time."""

import os

import pytest
from damage import complaint, damaged, told_or_read

from swarm_mj.cli import main
from swarm_mj.evaluation import progress
from swarm_mj.evaluation.batch import fly_batch
from swarm_mj.evaluation.study import Study
from swarm_mj.io.owned import owned
from swarm_mj.mission import paper

EVALUATE = ["evaluate", "--policy", "tdma", "--robots", "3", "--windows", "2", "--episodes", "30"]


@pytest.fixture
def evaluate(tmp_path):
    """Evaluates two batches of missions into one file, from a seed."""
    path = str(tmp_path / "o.csv")
    return lambda seed, *more: main([*EVALUATE, "--seed", str(seed), "--csv", path, *more])


@pytest.fixture
def interrupted(evaluate, tmp_path, monkeypatch):
    """The progress of an evaluation from a seed that was broken off after its first batch."""

    def append_and_stop(*batch):
        append(*batch)
        raise KeyboardInterrupt

    append, path = progress.append, tmp_path / "o.csv.progress"

    def interrupt(seed):
        with monkeypatch.context() as patch:
            patch.setattr(progress, "append", append_and_stop)
            assert evaluate(seed, "--force") == 130
        return path.read_bytes()

    return interrupt


@pytest.mark.fault("one output, one process")
def test_a_second_evaluation_of_one_output_is_refused(evaluate, tmp_path, capsys, record_property):
    """Fault 9: both wrote into one progress file."""
    for more in ((), ("--force",), ("--resume",)):
        with owned(tmp_path / "o.csv"):
            said = complaint(capsys, evaluate(1000, *more))
        assert f"o.csv is being written by process {os.getpid()}" in said
    assert list(tmp_path.iterdir()) == []
    record_property("tries", 3)


@pytest.mark.fault("what is resumed is one's own")
def test_progress_of_two_evaluations_is_refused(evaluate, interrupted, tmp_path, capsys):
    """Fault 9: what of other seeds got into a progress file was taken for its own."""
    other, mine = interrupted(2000).splitlines(keepends=True)[1], interrupted(1000)
    capsys.readouterr()
    path = tmp_path / "o.csv.progress"
    path.write_bytes(mine + other)
    assert "is damaged" in complaint(capsys, evaluate(1000, "--resume"))
    assert path.read_bytes() == mine + other
    path.write_bytes(mine)
    assert "its seed is 1000, not 2000" in complaint(capsys, evaluate(2000, "--resume"))
    assert evaluate(1000, "--resume") == 0


@pytest.mark.fault("damaged files are told")
def test_damaged_progress_is_told_or_dropped(tmp_path, record_property):
    """Fault 14, and more: a flip in a number was taken for another cost."""
    path, num_tries = tmp_path / "progress", 0
    study = Study(policies=("tdma",), regimes=(paper(num_robots=3, num_windows=2),), episodes=30)
    header = study.header()
    progress.start(path, header)
    for index, batch in enumerate(study.batches):
        progress.append(path, header, index, fly_batch(batch))
    whole = path.read_bytes()
    flown = progress.resume(path, header, study.batches)
    for content in damaged(whole):
        path.write_bytes(content)
        num_tries += 1
        resumed = told_or_read(lambda: progress.resume(path, header, study.batches))
        assert resumed is None or resumed.items() <= flown.items()
        assert resumed is not None or path.read_bytes() == content
    record_property("tries", num_tries)


CRAFTED = [
    "[" * 10**6,
    '{"a":' * 10**6,
    "NaN\n",
    '{"version": NaN}\n',
    "\0\n" * 1000,
    "x\n" * 10**6,
]


@pytest.mark.fault("crafted files are refused")
@pytest.mark.parametrize("content", [*CRAFTED, "a pipe"])
def test_crafted_progress_is_refused(evaluate, tmp_path, capsys, content):
    """Fault 14: RecursionError, NaN; a pipe was waited for."""
    path = tmp_path / "o.csv.progress"
    os.mkfifo(path) if content == "a pipe" else path.write_text(content)
    assert "progress" in complaint(capsys, evaluate(1000, "--resume"))
    assert path.exists()
    assert not (tmp_path / "o.csv").exists()
