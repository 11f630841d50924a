"""The scene's file as a process: what MuJoCo opens, and the start that a flight has."""

import mujoco
import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.simulation.swarm import Swarm


@pytest.mark.parametrize("seed", [1, 5])
def test_scene_writes_a_model_that_mujoco_opens_at_the_start_that_fly_has(succeed, tmp_path, seed):
    done = succeed("scene", "--task", "random-walk", "--seed", seed, "--out", "scene.xml")
    assert "40 robots" in done.stdout
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))
    assert model.nq == model.nv == model.nu == 80
    data = mujoco.MjData(model)
    flown = Swarm(paper("random-walk"), [seed]).states
    for start in (data.qpos.copy(), model.key_qpos[0]):  # as opened, and as the keyframe has it
        np.testing.assert_allclose(start.reshape(40, 2), flown.position_m[0], atol=1e-3)
    np.testing.assert_allclose(model.key_qvel[0].reshape(40, 2), flown.velocity_mps[0], atol=1e-5)


def test_scene_does_not_replace_a_file_unasked(succeed, refusal, tmp_path):
    (tmp_path / "scene.xml").write_text("mine")
    assert "scene.xml exists" in refusal("scene")
    assert (tmp_path / "scene.xml").read_text() == "mine"
    succeed("scene", "--force", "--robots", 3)
