"""A run's folder: its settings on disk, what may begin there, what kills leave, its size."""

import itertools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_runs import small_training

from swarm_mj.learning.graph_vec_env import env_of
from swarm_mj.learning.ppo import make_model
from swarm_mj.learning.run_folder import (
    CHECKPOINT,
    CURVE,
    POLICY,
    SETTINGS,
    Limits,
    TrainingRun,
    check_begun,
    check_new,
    read_curve,
    read_run,
    rollout_bytes,
    training_needs,
    write_run,
)
from swarm_mj.learning.settings import usual_settings
from swarm_mj.mission import paper
from swarm_mj.policies.gnn.packet_memory import empty_memory
from swarm_mj.replay.replay_size import ON_DISK
from swarm_mj.simulation.components import Components

LIMITS = Limits(decisions=5, minutes=0.5, replay_every=3)
RUN = TrainingRun(
    training=small_training(sizes=(4, 6)), limits=LIMITS, command="swarm-mj train --out x"
)


def test_a_run_is_read_as_it_was_written(tmp_path, monkeypatch):
    """A policy is named by its whole path, so that the run can go on from another folder."""
    monkeypatch.chdir(tmp_path)
    for run in (RUN, replace(RUN, init=tmp_path / "policy", limits=Limits())):
        write_run(tmp_path / "run", run if run.init is None else replace(run, init=Path("policy")))
        assert read_run(tmp_path / "run") == run


def test_settings_of_before_packets_were_considered_have_the_usual_number(tmp_path):
    write_run(tmp_path, RUN)
    whole = json.loads((tmp_path / SETTINGS).read_text())
    assert whole["training"]["ppo"].pop("considered") == 5.0
    (tmp_path / SETTINGS).write_text(json.dumps(whole))
    assert read_run(tmp_path) == RUN


def as_1_0_wrote(folder):
    """Changes a run's settings to what version 1.0 wrote, which had no names for some of them."""
    whole = json.loads((folder / SETTINGS).read_text())
    training = whole["training"]
    for name in ("most_speech", "unknown_age", "train_windows"):
        del training[name]
    for name in ("horizon", "considered", "kept"):
        del training["ppo"][name]
    training["ppo"]["silent_share"] = 0.1
    (folder / SETTINGS).write_text(json.dumps(whole))


def test_a_run_of_version_1_0_is_looked_at_but_does_not_go_on(tmp_path):
    """It bounded no speech, drew no lengths, and credited a packet with its own window alone."""
    write_run(tmp_path, RUN)
    as_1_0_wrote(tmp_path)
    training = read_run(tmp_path, named=None).training
    assert (training.most_speech, training.unknown_age, training.train_windows) == (1.0, 0.0, ())
    assert (training.ppo.horizon, training.ppo.considered, training.ppo.kept) == (1, 1.0, 0.0)
    way_out = rf"version 1.0 or before, .*--init {tmp_path} --features {training.features}, in"
    with pytest.raises(ValueError, match=way_out):
        read_run(tmp_path)


def test_damaged_settings_of_version_1_0_are_refused(tmp_path):
    write_run(tmp_path, RUN)
    as_1_0_wrote(tmp_path)
    whole = json.loads((tmp_path / SETTINGS).read_text())
    whole["training"]["seed"] = "3"
    (tmp_path / SETTINGS).write_text(json.dumps(whole))
    with pytest.raises(ValueError, match="are damaged, no run's, or from an earlier version"):
        read_run(tmp_path)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "{}", '{"format": "swarm_mj policy"}'])
def test_what_is_no_settings_is_refused(tmp_path, text):
    (tmp_path / SETTINGS).write_text(text)
    with pytest.raises(
        ValueError, match=r"settings .*settings.json are damaged, no run's, or from"
    ):
        read_run(tmp_path)


@pytest.mark.parametrize(
    ("part", "changes", "complaint"),
    [
        ((), {"format_version": 3}, "format_version is 3, and this swarm_mj reads 2"),
        (("training",), {"seed": "3"}, r"Expected `int`, got `str` - at `.*seed`"),
        (("training", "ppo"), {"clip": None}, r"Expected `float`, got `null` - at `.*clip`"),
        (("training",), {"arm": "team"}, "an earlier version: .*`arm`"),
        (("training", "network"), {"latent": 0}, "latent must be a whole number from 1 to"),
    ],
)
def test_settings_of_another_kind_are_refused(tmp_path, part, changes, complaint):
    write_run(tmp_path, RUN)
    whole = json.loads((tmp_path / SETTINGS).read_text())
    changed = whole
    for name in part:
        changed = changed[name]
    changed |= changes
    (tmp_path / SETTINGS).write_text(json.dumps(whole))
    with pytest.raises(ValueError, match=complaint):
        read_run(tmp_path)


def test_a_folder_without_a_run_says_how_to_begin_one(tmp_path):
    with pytest.raises(ValueError, match="holds no run to go on with; to begin one, leave out"):
        read_run(tmp_path / "nothing")


def test_runs_begin_in_folders_of_their_own(tmp_path):
    for name in ("new", "empty"):
        check_new(tmp_path / name)
        (tmp_path / "empty").mkdir(exist_ok=True)
    (tmp_path / "empty" / f".{SETTINGS}.123.part").touch()  # a run killed while it began
    check_new(tmp_path / "empty")
    (tmp_path / "file").touch()
    (tmp_path / "empty" / "thesis.tex").touch()
    write_run(tmp_path / "run", RUN)
    for name, complaint in (
        ("file", "file is a file; name a folder"),
        ("empty", "holds thesis.tex; go on with a run"),
        ("run", "holds settings.json; go on with a run by --resume"),
    ):
        with pytest.raises(ValueError, match=complaint):
            check_new(tmp_path / name)


@pytest.mark.parametrize("name", [CURVE, POLICY])
def test_a_run_that_lost_its_checkpoint_cannot_go_on(tmp_path, name):
    write_run(tmp_path, RUN)
    check_begun(tmp_path)  # it was killed before its first
    (tmp_path / name).mkdir()
    with pytest.raises(ValueError, match=r"has lost its checkpoint.pt, so its run cannot go on"):
        check_begun(tmp_path)
    (tmp_path / CHECKPOINT).touch()
    check_begun(tmp_path)


def test_links_out_of_a_run_are_refused(tmp_path):
    write_run(tmp_path / "run", RUN)
    (tmp_path / "run" / "replays").mkdir()
    (tmp_path / "run" / "alias").symlink_to("replays")
    check_begun(tmp_path / "run")
    (tmp_path / "run" / "replays" / "a.rrd").symlink_to(tmp_path / "mine")
    with pytest.raises(ValueError, match=r"a.rrd is a link that leads out of the run"):
        check_begun(tmp_path / "run")


def test_a_runs_own_parts_must_be_named(tmp_path):
    components = Components(channel="my_parts:Lossy", scene="my_parts:walls")
    run = replace(RUN, training=replace(RUN.training, components=components))
    write_run(tmp_path, run)
    with pytest.raises(ValueError, match="--channel my_parts:Lossy --scene my_parts:walls again"):
        read_run(tmp_path, ["my_parts:Lossy"])
    assert read_run(tmp_path, ["my_parts:Lossy", "my_parts:walls"]) == run


# What a run takes of memory and disk.


@pytest.mark.parametrize(("credit", "robots"), [("robot", 6), ("team", 6), ("robot", 40)])
def test_a_rollout_is_of_the_arrays_that_are_made(credit, robots):
    """With what robots remember, and windows replayed for all robots, who might have spoken."""
    mission = paper("stationary", num_robots=robots, range_ratio=0.5)
    training = replace(usual_settings(credit, mission, (robots,)), missions=4)
    model = make_model(training)
    made = sum(rows.nbytes for rows in model.rollout_buffer.observations.values())
    if credit == "robot":
        made += sum(array.nbytes for array in empty_memory(4, robots))
        env = env_of(model)
        own = np.tile(np.arange(robots), 4)
        env.considered_recipient = lambda: (own + 1) % robots
        env.reset()
        for _ in range(training.ppo.num_steps):
            env.step(own)
        for window in itertools.chain(*env._windows):
            made += sum(array.nbytes for array in window if isinstance(array, np.ndarray))
    assert made < rollout_bytes(training) < 2.0 * made


def test_replays_of_a_training_are_counted():
    training = usual_settings("robot", paper("random-walk"), (40,))
    none = training_needs(training, Limits(decisions=1000))
    ten = training_needs(training, Limits(decisions=1000, replay_every=100))
    each = ON_DISK.of(training.mission, training.mission.num_windows)
    assert ten.file - none.file == pytest.approx(11 * each)
    assert ten.memory > none.memory
    shown = training_needs(training, Limits(decisions=1000), is_shown=True)
    assert (shown.memory, shown.file) == (ten.memory, none.file)


def test_a_curve_is_read_by_the_names_of_its_columns_and_empty_cells_are_left_out(tmp_path):
    path = tmp_path / "curve.csv"
    path.write_text("decisions,aoi,aoi_sem,aoi_tdma,train/entropy\n0,60,4,25,\n128,30.5,,,nan\n")
    first, second = read_curve(path)
    assert first == (0.0, 60.0, 4.0, {"tdma": 25.0}, {})
    assert second == (128.0, 30.5, None, {}, {})


@pytest.mark.parametrize("text", ["a,b\n1,2\n", "decisions,aoi\n0,x\n", "decisions,aoi\n0,\n"])
def test_what_is_no_curve_is_refused(tmp_path, text):
    (tmp_path / "other.csv").write_text(text)
    with pytest.raises(ValueError, match=r"other\.csv is no learning curve, of decisions and aoi"):
        read_curve(tmp_path / "other.csv")


def test_a_run_with_own_parts_is_read_to_look_at_without_naming_them(tmp_path):
    own = replace(usual_settings("robot", paper("stationary"), (5,)), features="my:Ages")
    write_run(tmp_path, TrainingRun(training=own, limits=Limits(decisions=1)))
    with pytest.raises(ValueError, match="goes on with someone's own my:Ages"):
        read_run(tmp_path)
    assert read_run(tmp_path, named=None).training == own
