"""The scene's file as a process: what MuJoCo opens, and the start that a flight has."""

from contextlib import nullcontext

import mujoco
import numpy as np
import pytest

from swarm_mj.cli import main
from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.rollout import rollout
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


class Window:
    """In place of MuJoCo's window, one that keeps what it is shown, and is closed after a while."""

    def __init__(self, model, data, num_pictures):
        self.model, self.data = model, data
        self.user_scn = mujoco.MjvScene(model, 10_000)
        self.cam, self.opt = mujoco.MjvCamera(), mujoco.MjvOption()
        self.lock = nullcontext
        self.num_pictures = num_pictures
        self.shown_m = []

    def is_running(self):
        return len(self.shown_m) < self.num_pictures

    def sync(self):
        self.shown_m.append(self.data.qpos.copy())

    def close(self):
        self.num_pictures = 0


@pytest.fixture
def opened(monkeypatch):
    """The windows that `scene --view` opens, each closed after a number of pictures."""
    windows = []
    viewer = pytest.importorskip("mujoco.viewer")
    monkeypatch.setattr("glfw.init", lambda: True)
    monkeypatch.setattr("swarm_mj.replay.view.has_display", lambda: True)
    monkeypatch.setattr("time.sleep", lambda _: None)

    def launch(model, data, **_):
        windows.append(Window(model, data, num_pictures=34))
        return windows[-1]

    monkeypatch.setattr(viewer, "launch_passive", launch)
    return windows


def test_view_flies_quadrotors_until_the_window_is_closed(opened, here):
    """The fifth picture of a window is where the simulation has the robots; then it begins anew."""
    flight = ["--robot", "quadrotor", "--robots", "3", "--windows", "4", "--range-ratio", "2"]
    assert main(["scene", "--view", "--task", "random-walk", *flight]) == 0
    (window,) = opened
    pictures_m = np.array(window.shown_m).reshape(34, 3, 7)[..., :3]
    mission = paper("random-walk", robot="quadrotor", num_robots=3, num_windows=4, range_ratio=2)
    swarm = Swarm(mission, [1])
    flown = rollout(swarm, make_policy("planner", mission))
    flown_m = [swarm.states.position_m[0] for _ in flown]
    # A picture of the first window's end, and three windows of five pictures to the last one's.
    np.testing.assert_allclose(pictures_m[0:16:5], flown_m, atol=1e-9)
    third_m = 0.4 * flown_m[0] + 0.6 * flown_m[1]
    np.testing.assert_allclose(pictures_m[3], third_m, atol=1e-9)
    np.testing.assert_allclose(pictures_m[21], pictures_m[5], atol=1e-9)
    assert window.cam.type == mujoco.mjtCamera.mjCAMERA_TRACKING
    assert window.model.body(window.cam.trackbodyid).name == "r0/body"
    assert list(here.iterdir()) == []


def test_view_shows_a_mission_of_one_window(opened):
    assert main(["scene", "--view", "--robots", "3", "--windows", "1", "--range-ratio", "2"]) == 0
    (window,) = opened
    assert len(window.shown_m) == 34
    assert np.ptp(window.shown_m, axis=0).max() == 0.0


def test_view_shows_points_on_their_map(opened):
    assert main(["scene", "--view", "--robots", "3", "--windows", "3", "--range-ratio", "2"]) == 0
    (window,) = opened
    assert window.cam.type == mujoco.mjtCamera.mjCAMERA_FREE
    assert np.ptp(window.shown_m, axis=0).max() > 0.01


def test_without_a_display_the_ways_out_are_named(monkeypatch, capsys):
    monkeypatch.setattr("swarm_mj.replay.view.has_display", lambda: False)
    assert main(["scene", "--view"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "there is no display" in said
    assert "swarm-mj fly --live web" in said


def test_view_writes_no_file(here, capsys):
    for option in (["--out", "a.xml"], ["--force"]):
        assert main(["scene", "--view", *option]) == 2
        assert "--view writes none; leave them out" in capsys.readouterr().err
    assert list(here.iterdir()) == []
