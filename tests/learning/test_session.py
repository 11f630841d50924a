"""What a session of a run counts, by a clock of the test's own."""

from dataclasses import replace
from types import SimpleNamespace

from small_runs import run

from swarm_mj.learning import held_out, index_checkpoint, session
from swarm_mj.learning.settings import usual_index_settings
from swarm_mj.mission import paper

CANDIDATES = 12
GENERATION = CANDIDATES * 2 * 12  # decisions
SMALL = replace(
    usual_index_settings(paper("stationary", num_windows=12), (4,), seed=3),
    missions=2,
    evaluate_every=2 * GENERATION,
    held_out=2,
)


class Clock:
    """A clock that stands still, but for what goes on `after` some seconds."""

    def __init__(self):
        self.now_s = 0.0

    def monotonic(self):
        return self.now_s

    def after(self, seconds, work):
        def slow(*given, **others):
            self.now_s += seconds
            return work(*given, **others)

        return slow


def test_the_rate_of_decisions_is_of_training_alone(monkeypatch, tmp_path):
    """Each window of training takes 2 s, and all else far longer."""
    clock = Clock()
    monkeypatch.setattr(session, "time", SimpleNamespace(monotonic=clock.monotonic))
    for module, name, seconds in (
        (held_out, "evaluate", 100.0),
        (held_out, "record_replay", 1000.0),
        (index_checkpoint, "save", 10_000.0),
    ):
        monkeypatch.setattr(module, name, clock.after(seconds, getattr(module, name)))

    def listener(_status):
        clock.now_s += 2.0
        return True

    progress = run(SMALL, tmp_path / "run", 4 * GENERATION, listener, replay_every=GENERATION)
    rows = progress.curve[1:]
    assert [row.decisions for row in rows] == [2 * GENERATION, 4 * GENERATION]
    for row in rows:
        assert row.training["rollout/decisions_per_s"] == CANDIDATES * 2 / 2.0
    assert progress.minutes * 60.0 > 10_000.0
