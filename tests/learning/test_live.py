"""Trainings that are shown: what the viewer gets, and that the run is the same as ever."""

import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from reading import entities, static
from rerun.chunk import RrdReader
from small_runs import StopAfter, difference, end_of, evaluation, go_on, small_training

from swarm_mj.learning import held_out
from swarm_mj.learning.live import LiveTraining, training_curve
from swarm_mj.learning.ppo import make_model, networks_of
from swarm_mj.learning.run_folder import Limits, TrainingRun
from swarm_mj.learning.train import train
from swarm_mj.replay import live as replay_live
from swarm_mj.replay.view import LiveViewer

TRAINING = small_training()


class Process:
    """A viewer's, until it is closed."""

    code = None

    def poll(self):
        return self.code


@pytest.fixture
def viewer(monkeypatch, tmp_path):
    """A viewer that keeps what it is sent in files, in order, and can be closed."""
    sent = []

    def connect(recording, _address):
        path = tmp_path / f"sent-{len(sent)}.rrd"
        sent.append(path)
        recording.save(path)

    monkeypatch.setattr(replay_live.rr.RecordingStream, "connect_grpc", connect)
    process = Process()
    return SimpleNamespace(
        live=LiveTraining(LiveViewer(process=process, address="nowhere", page=None)),
        process=process,
        sent=sent,
    )


def trained(folder, decisions=128, listener=go_on, **others):
    limits = Limits(decisions=decisions, checkpoint_every_s=0.0)
    asked = TrainingRun(training=TRAINING, limits=limits, device="cpu")
    return train(asked, folder, listener=listener, **others)


def shown(path):
    """How many evaluations a curve has, the lines' names, and the name of the recording."""
    names = static(path, "/learning/names", "Points2D:labels").tolist()
    points = static(path, "/learning/points", "Points2D:positions").reshape(-1, 2)
    (about,) = static(path, "/about", "TextDocument:text")
    return len(points), names, about.splitlines()[0]


def test_each_evaluation_is_a_flight_beside_the_curve_so_far(viewer, tmp_path):
    progress = trained(tmp_path / "run", live=viewer.live)
    assert [row.decisions for row in progress.curve] == [0, 64, 128]
    assert len(viewer.sent) == 3
    for number, (path, row) in enumerate(zip(viewer.sent, progress.curve, strict=True), start=1):
        num_points, names, about = shown(path)
        assert num_points == number
        assert about == f"# after {row.decisions} decisions"
        references = [
            f"{name} {row.references[f'aoi_{name}'.replace('-', '_')]:.2f}"
            for name in ("tdma", "spatial-tdma", "lookahead-oracle")
        ]
        assert names == [f"policy in training {row.costs.aoi:.2f}", *references]
        assert "/scene/robots" in entities(path)


def test_what_is_shown_is_the_first_held_out_mission(viewer, tmp_path):
    """It is the replay that --replay-every keeps of the same policy."""
    limits = Limits(decisions=1, replay_every=1)
    asked = TrainingRun(training=TRAINING, limits=limits, device="cpu")
    train(asked, tmp_path / "run", listener=go_on, live=viewer.live)
    for path in viewer.sent[:2]:
        (_, _, about) = shown(path)
        decisions = int(about.split()[2])
        kept = tmp_path / "run" / "replays" / f"decisions-{decisions:09d}.rrd"
        for entity, component in (
            ("/plots/age/mean", "Measurements:values"),
            ("/packets", "recipient"),
        ):
            assert values(path, entity, component) == values(kept, entity, component)


def values(path, entity, component):
    """A component in all windows."""
    found = []
    for chunk in RrdReader(path).stream().filter(content=entity):
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            found += batch.column(component).to_pylist()
    return found


def test_the_layout_comes_once_so_that_a_user_s_tab_stays(viewer, tmp_path):
    trained(tmp_path / "run", live=viewer.live)
    assert [len(RrdReader(path).blueprints()) for path in viewer.sent] == [1, 0, 0]


def test_all_flights_of_a_training_are_of_one_application(viewer, tmp_path):
    """Which share a layout; replays of such missions have their own."""
    trained(tmp_path / "run", live=viewer.live)
    names = set()
    for path in viewer.sent:
        (store,) = RrdReader(path).recordings()
        names.add(store.application_id)
    (name,) = names
    assert name.startswith("training - stationary - 5 robots")


def test_a_run_that_is_shown_ends_as_one_that_is_not_to_the_bit(viewer, tmp_path):
    trained(tmp_path / "plain", 192)
    trained(tmp_path / "shown", 192, live=viewer.live)
    assert len(viewer.sent) == 4
    assert difference(end_of(tmp_path / "plain"), end_of(tmp_path / "shown")) == ""


def test_showing_draws_from_no_generator_of_the_training(viewer):
    network = networks_of(make_model(TRAINING, "cpu")).acting_network()
    before = torch.get_rng_state(), np.random.get_state()  # noqa: NPY002
    flown = held_out.record_first(TRAINING, network, lambda _share: None)
    viewer.live.show(TRAINING, flown, 0, [evaluation(0)])
    assert torch.equal(torch.get_rng_state(), before[0])
    after = np.random.get_state()  # noqa: NPY002
    assert all(np.array_equal(a, b) for a, b in zip(after, before[1], strict=True))


def test_a_run_goes_on_with_a_viewer_or_without(viewer, tmp_path):
    """It shows at once what it has come to, and ends as one that was never stopped."""
    trained(tmp_path / "whole", 192)
    trained(tmp_path / "cut", 192, StopAfter(20))
    shutil.copytree(tmp_path / "cut", tmp_path / "other")
    trained(tmp_path / "cut", 192, live=viewer.live, is_resumed=True)
    num_before, *_ = shown(viewer.sent[0])
    num_after, *_ = shown(viewer.sent[-1])
    assert (num_before, num_after) == (2, 4)
    trained(tmp_path / "other", 192, is_resumed=True)
    for folder in ("cut", "other"):
        assert difference(end_of(tmp_path / "whole"), end_of(tmp_path / folder)) == "", folder


def test_a_run_that_is_over_is_shown_when_it_is_resumed(viewer, tmp_path):
    trained(tmp_path / "run")
    heard = []
    trained(tmp_path / "run", listener=heard.append, live=viewer.live, is_resumed=True)
    (path,) = viewer.sent
    assert shown(path)[0] == 3
    assert heard == []


def test_a_viewer_that_was_closed_is_said_once_and_the_run_goes_on(viewer, tmp_path):
    complaints = []

    def closes(status):
        if status.progress.decisions >= 32:
            viewer.process.code = 0
        return True

    progress = trained(
        tmp_path / "run", listener=closes, live=viewer.live, complain=complaints.append
    )
    assert progress.choice is not None
    assert len(viewer.sent) == 1
    assert complaints == [
        "The viewer failed (ConnectionError: it was closed); the run goes on without it."
    ]


def test_a_viewer_that_fails_does_not_end_a_run(viewer, monkeypatch, tmp_path):
    def fails(*_):
        raise RuntimeError("bad\ndata")

    complaints = []
    monkeypatch.setattr(replay_live, "draw_training_curve", fails)
    progress = trained(tmp_path / "run", live=viewer.live, complain=complaints.append)
    assert progress.decisions == 128
    assert complaints == ["The viewer failed (RuntimeError: bad data); the run goes on without it."]


def test_one_who_stops_does_not_wait_for_the_flight_to_be_shown(viewer, tmp_path):
    """The evaluation counts; what was shown before stays."""

    def stops(status):
        return status.what != "Showing" or len(viewer.sent) == 0

    progress = trained(tmp_path / "run", listener=stops, live=viewer.live)
    assert [row.decisions for row in progress.curve] == [0, 64]
    assert len(viewer.sent) == 1


def test_the_time_of_showing_is_none_of_the_time_of_decisions(viewer, tmp_path):
    clock = SimpleNamespace(s=0.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("swarm_mj.learning.session.time.monotonic", lambda: clock.s)

        def show(*_):
            clock.s += 600.0

        patch.setattr(viewer.live, "show", show)
        progress = trained(tmp_path / "run", 64, live=viewer.live)
    assert progress.minutes == pytest.approx(20.0)
    assert progress.since_evaluation.seconds < 1.0


def test_the_curve_is_of_the_cost_to_lower_with_the_references_that_flew():
    rows = [
        replace(
            evaluation(at, aoi=30.0, aoi_sem=2.0, velocity_variance=0.25),
            references={"aoi_tdma": 9.0, "aoi_behind_tdma": 21.0, "velocity_variance_tdma": 0.1},
        )
        for at in (0, 64)
    ]
    ages = training_curve(TRAINING, rows)
    assert ages.title == "age of information [windows]"
    assert (ages.cost.tolist(), ages.sem.tolist()) == ([30.0, 30.0], [2.0, 2.0])
    assert ages.decisions.tolist() == [0.0, 64.0]
    assert ages.references == {"tdma": 9.0}
    flock = small_training("team", "flocking", reward="velocity-variance")
    variances = training_curve(flock, rows)
    assert variances.title == "velocity variance [m²/s²]"
    assert (variances.cost.tolist(), variances.sem.tolist()) == ([0.25, 0.25], [0.0, 0.0])
    assert variances.references == {"tdma": 0.1}
