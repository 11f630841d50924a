"""The other commands as processes: scene, replay, bench, help."""

from functools import partial

import mujoco
import numpy as np
import pytest

from swarm_mj.benchmark import learning
from swarm_mj.cli import main
from swarm_mj.mission import paper
from swarm_mj.swarm import Swarm


def test_scene_writes_a_model_that_mujoco_opens(swarm_mj, tmp_path):
    done = swarm_mj("scene", "--robots", 40, "--out", "scene.xml")
    assert done.returncode == 0, done.stderr
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))
    assert model.nq == model.nv == model.nu == 80
    assert "40 robots" in done.stdout


@pytest.mark.parametrize("seed", [1, 5])
def test_scene_shows_the_start_that_fly_has(swarm_mj, tmp_path, seed):
    done = swarm_mj("scene", "--task", "random-walk", "--seed", seed, "--out", "scene.xml")
    assert done.returncode == 0, done.stderr
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))
    data = mujoco.MjData(model)
    flown = Swarm(paper("random-walk"), [seed]).states
    for start in (data.qpos.copy(), model.key_qpos[0]):  # as opened, and as the keyframe has it
        np.testing.assert_allclose(start.reshape(40, 2), flown.position_m[0], atol=1e-3)
    np.testing.assert_allclose(model.key_qvel[0].reshape(40, 2), flown.velocity_mps[0], atol=1e-5)


def test_scene_does_not_replace_a_file_unasked(swarm_mj, tmp_path):
    (tmp_path / "scene.xml").write_text("mine")
    assert swarm_mj("scene").returncode == 2
    assert (tmp_path / "scene.xml").read_text() == "mine"
    assert swarm_mj("scene", "--force", "--robots", 3).returncode == 0


@pytest.mark.parametrize("arguments", [["scene", "--robots", "1"], ["scene", "--out", "."]])
def test_scene_refuses_bad_input(swarm_mj, arguments):
    done = swarm_mj(*arguments)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1


def test_replay_refuses_what_is_no_whole_replay(swarm_mj, tmp_path):
    swarm_mj("fly", "--windows", 5, "--record", "whole.rrd")
    whole = (tmp_path / "whole.rrd").read_bytes()
    (tmp_path / "cut.rrd").write_bytes(whole[: len(whole) // 2])
    for name in ("cut.rrd", "missing.rrd"):
        for web in ([], ["--web"]):
            done = swarm_mj("replay", name, *web)
            assert done.returncode == 2
            assert name in done.stderr
            assert len(done.stderr.strip().splitlines()) == 1


def test_bench_prints_the_whole_and_its_parts(swarm_mj):
    short = ("--seconds", 0.1, "--episodes", 1, "--no-learning")
    done = swarm_mj("bench", "--missions", 1, 3, *short)
    assert done.returncode == 0, done.stderr
    for row in ("windows per second", "plain mj_step", "radio and buffers", "move", "decide"):
        assert row in done.stdout
    for row in (
        "Evaluation: 1 random walks",
        "random-flooding, round-robin, mst; 2 jobs",
        "greedy-oracle",
    ):
        assert row in done.stdout
    assert "Learning" not in done.stdout


def test_bench_times_learning_and_leaves_the_evaluation_out(monkeypatch, capsys):
    """In teams of 4, for speed."""
    monkeypatch.setattr(learning, "learning_rows", partial(learning.learning_rows, num_robots=4))
    assert main(["bench", "--missions", "1", "--seconds", "0.1", "--episodes", "0"]) == 0
    printed = capsys.readouterr().out
    assert "Evaluation" not in printed
    for row in ("forward and backward", "training, arm robot", "training, arm team", "decision"):
        assert row in printed


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--missions", "0"], "missions must be a whole number from 1 to 10000, not 0"),
        (["--threads", "0"], "threads must be a whole number from 1 to 256, not 0"),
        (["--episodes", "-1"], "episodes must be a whole number from 0 to 10000, not -1"),
        (["--jobs", "0"], "jobs must be a whole number from 1 to 256, not 0"),
        (["--seconds", "nan"], "seconds must be a number from 0.1 to 600 [s], not nan"),
    ],
)
def test_bench_refuses_bad_input(swarm_mj, options, complaint):
    done = swarm_mj("bench", *options)
    assert done.returncode == 2
    assert complaint in done.stderr


def test_no_command_and_version(swarm_mj):
    assert swarm_mj().returncode == 2
    assert swarm_mj("--version").stdout.startswith("swarm-mj ")
