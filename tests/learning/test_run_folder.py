"""A run's folder: its settings on disk, what may begin there, what kills leave, the curve."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_runs import small_training

from swarm_mj.learning.graph_vec_env import GraphVecEnv
from swarm_mj.learning.run_folder import (
    CHECKPOINT,
    CURVE,
    POLICY,
    SETTINGS,
    Accumulator,
    Limits,
    Progress,
    TrainingRun,
    check_begun,
    check_new,
    read_run,
    write_run,
)
from swarm_mj.mission.components import Components

LIMITS = Limits(decisions=5, minutes=0.5, replay_every=3)
ROW = {"decisions": 10.0, "aoi": 1 / 3, "objective": 0.2}
RUN = TrainingRun(
    training=small_training(sizes=(4, 6)), limits=LIMITS, command="swarm-mj train --out x"
)


def test_a_run_is_read_as_it_was_written(tmp_path, monkeypatch):
    """A policy is named by its whole path, so that the run can go on from another folder."""
    monkeypatch.chdir(tmp_path)
    for run in (RUN, replace(RUN, init=tmp_path / "policy", limits=Limits())):
        write_run(tmp_path / "run", run if run.init is None else replace(run, init=Path("policy")))
        assert read_run(tmp_path / "run") == run


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
        (("training",), {"missions": True}, r"Expected `int`, got `bool` - at `.*missions`"),
        (("training", "ppo"), {"clip": None}, r"Expected `float`, got `null` - at `.*clip`"),
        (("training",), {"robots": ["4"]}, r"Expected `int`, got `str` - at `.*robots.*`"),
        (("training",), {"arm": "team"}, "an earlier version: .*`arm`"),
        (("training", "network"), {"latent": 0}, "latent must be a whole number from 1 to"),
        (("limits",), {"wings": 2}, "wings"),
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
        ("empty", r"holds thesis.tex, which is no run's"),
        ("run", "holds a run; go on with it by --resume"),
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


def test_the_best_is_the_least_objective_and_the_first_of_equals():
    assert Progress().best is None
    rows = [ROW | {"objective": x, "decisions": float(n)} for n, x in enumerate((3.0, 1.0, 1.0))]
    assert Progress(curve=rows).best is rows[1]


def test_totals_are_per_mission_and_window():
    training = small_training("team", sizes=(3,), groups=2)
    env = GraphVecEnv(training, np.random.default_rng(1))
    env.reset()
    accumulator, ages, sent, arrived = Accumulator(), [], 0, 0
    assert accumulator.means() == {}
    for _ in range(5):
        env.step(np.array([[1, 1, 2], [0, 2, 0], [0, 1, 2], [0, 1, 1]]))
        accumulator.add(env.costs)
        ages += [age for its in env.costs for age in its.age_windows]
        sent += sum(its.packets.attempted.sum() for its in env.costs)
        arrived += sum(its.packets.delivered.sum() for its in env.costs)
    accumulator.seconds = 4.0
    means = accumulator.means()
    assert means["rollout/aoi"] == pytest.approx(sum(ages) / 20)
    assert means["rollout/packets_per_window"] == sent / 20 == 1.0
    assert means["rollout/delivery_ratio"] == pytest.approx(arrived / sent)
    assert means["rollout/decisions_per_s"] == 5.0


def test_a_curve_is_a_table_even_if_later_rows_have_more_columns(tmp_path):
    Progress(curve=[ROW, ROW | {"train/entropy": 0.5}]).write_curve(tmp_path)
    with (tmp_path / "curve.csv").open(newline="") as file:
        first, second = csv.DictReader(file)
    assert {name: float(x) for name, x in first.items() if x} == ROW
    assert float(second["train/entropy"]) == 0.5


def test_a_runs_own_parts_must_be_named(tmp_path):
    components = Components(channel="my_parts:Lossy", scene="my_parts:walls")
    run = replace(RUN, training=replace(RUN.training, components=components))
    write_run(tmp_path, run)
    with pytest.raises(ValueError, match="--channel my_parts:Lossy --scene my_parts:walls again"):
        read_run(tmp_path, ["my_parts:Lossy"])
    assert read_run(tmp_path, ["my_parts:Lossy", "my_parts:walls"]) == run
