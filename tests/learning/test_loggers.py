"""Loggers of users' own hear of every evaluation, and never end a run."""

import json

import pytest
from small_runs import go_on, small_training

from swarm_mj.learning.loggers import Guarded, make_logger
from swarm_mj.learning.run_folder import SETTINGS, Limits, TrainingRun
from swarm_mj.learning.train import train


class Notes:
    """Keeps what it hears, and fails at one of its calls, if it is to."""

    def __init__(self, fails_at=""):
        self.heard = []
        self.fails_at = fails_at

    def _hear(self, what, *its):
        self.heard.append((what, *its))
        if what == self.fails_at:
            raise ConnectionError("no\nnetwork")

    def start(self, settings, folder):
        self._hear("start", settings, folder)

    def log(self, row, decisions):
        self._hear("log", row, decisions)

    def finish(self):
        self._hear("finish")


def trained(folder, logger, **others):
    asked = TrainingRun(training=small_training(), limits=Limits(decisions=128), device="cpu")
    return train(asked, folder, listener=go_on, logger=logger, **others)


def test_it_gets_the_settings_all_evaluations_and_the_end(tmp_path):
    notes = Notes()
    progress = trained(tmp_path / "run", notes)
    (what, settings, folder), *rows, last = notes.heard
    assert (what, folder, last) == ("start", tmp_path / "run", ("finish",))
    stored = json.loads((tmp_path / "run" / SETTINGS).read_text())
    assert settings["training"]["robots"] == tuple(stored["training"]["robots"])
    assert rows == [("log", row.columns(), row.decisions) for row in progress.curve]
    assert len(rows) == 3


@pytest.mark.parametrize("fails_at", ["start", "log", "finish"])
def test_one_that_fails_is_heard_of_once_and_the_run_goes_on(tmp_path, fails_at):
    notes, complaints = Notes(fails_at), []
    progress = trained(tmp_path / "run", notes, complain=complaints.append)
    assert progress.decisions == 128
    assert progress.choice is not None
    assert complaints == [
        "The logger Notes failed (ConnectionError: no network); the run goes on without it."
    ]
    assert [what for what, *_ in notes.heard].count(fails_at) == 1


def test_without_anyone_to_complain_to_it_warns():
    with pytest.warns(UserWarning, match="The logger Notes failed"):
        Guarded(Notes("finish"), "logger Notes", None).do(lambda notes: notes.finish())
    Guarded(None, "logger", None).do(lambda notes: notes.finish())


def test_what_failed_is_no_longer_there():
    guarded = Guarded(Notes("finish"), "logger", lambda _: None)
    guarded.do(lambda notes: notes.start({}, None))
    assert guarded.is_there
    guarded.do(lambda notes: notes.finish())
    assert not guarded.is_there
    assert not Guarded(None, "logger", None).is_there


def test_it_is_loaded_by_name_and_must_be_one(here):
    (here / "their_logger.py").write_text(
        "class Mine:\n"
        "    def __init__(self, folder): self.folder = folder\n"
        "    def start(self, settings, folder): pass\n"
        "    def log(self, row, decisions): pass\n"
        "    def finish(self): pass\n"
        "class Half:\n"
        "    def start(self, settings, folder): pass\n"
    )
    assert make_logger("their_logger:Mine", here / "run").folder == here / "run"
    with pytest.raises(
        ValueError, match="logger their_logger:Half must have start, log and finish"
    ):
        make_logger("their_logger:Half", here / "run")
