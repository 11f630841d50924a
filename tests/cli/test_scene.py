"""The scene's file as a process: what MuJoCo opens, and the start that a flight has."""

import mujoco
import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.simulation.swarm import Swarm


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
