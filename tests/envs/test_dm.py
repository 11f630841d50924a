import os
import subprocess
import sys
import unittest

import mujoco
import numpy as np
import pytest
from dm_control.viewer import runtime
from dm_env import StepType, test_utils

from swarm_mj.envs.dm import make_environment
from swarm_mj.mission import paper
from swarm_mj.simulation.swarm import Swarm

MODES = ["exact", "contact"]


def small(task="random-walk", num_robots=6, **numbers):
    """A team that is wholly connected, or nearly, so that packets arrive."""
    return paper(task, num_robots=num_robots, range_ratio=0.4, **numbers)


def random_recipients(num_windows, num_robots=6, seed=0):
    return np.random.default_rng(seed).integers(0, num_robots, size=(num_windows, num_robots))


class TestDmEnvsOwnLaws(test_utils.EnvironmentTestMixin, unittest.TestCase):
    def make_object_under_test(self):
        return make_environment(small(num_windows=7))

    def make_action_sequence(self):
        yield from random_recipients(20)


@pytest.mark.parametrize("physics", MODES)
def test_dm_controls_physics_shows_the_swarm(physics):
    environment = make_environment(small(physics=physics))
    environment.reset()
    shown, swarm = environment.physics, environment.physics.swarm
    for window, recipient in enumerate([None, *random_recipients(15)]):
        if recipient is not None:
            environment.step(recipient)
        assert shown.time() == pytest.approx(0.1 * window)
        for i in range(6):
            x_m, y_m = swarm.states.position_m[0, i]
            vx_mps, vy_mps = swarm.states.velocity_mps[0, i]
            assert shown.named.data.qpos[[f"r{i}/x", f"r{i}/y"]].tolist() == [x_m, y_m]
            assert shown.named.data.qvel[[f"r{i}/x", f"r{i}/y"]].tolist() == [vx_mps, vy_mps]
            assert shown.named.data.xpos[f"r{i}/body"].tolist() == [x_m, y_m, 1.0]


def test_eq15_shown_state_would_fly_on_in_mujoco_alone():
    """Exact physics in the open: MuJoCo's own step of the state shown is the next window's p."""
    environment = make_environment(small(boundary="none"))
    environment.reset()
    for recipient in random_recipients(10):
        still = environment.physics.copy()
        mujoco.mj_step(still.model.ptr, still.data.ptr)
        environment.step(recipient)
        np.testing.assert_allclose(still.position(), environment.physics.position(), rtol=1e-13)


# 3 and 6 windows of 0.1 s are where counting in seconds would fly one window too many.
@pytest.mark.parametrize("num_windows", [1, 3, 6, 10])
def test_episode_is_cut_off_after_the_last_window(num_windows):
    environment = make_environment(small(num_windows=num_windows))
    for _ in range(2):
        steps = [environment.step(range(6)) for _ in range(num_windows + 1)]
        types = [StepType.FIRST, *[StepType.MID] * (num_windows - 1), StepType.LAST]
        assert [step.step_type for step in steps] == types
        assert [step.discount for step in steps] == [None, *[1.0] * num_windows]
        assert [step.observation["now"] for step in steps] == list(range(num_windows + 1))


def test_every_episode_has_the_next_seed():
    environment = make_environment(small(), seed=5)
    for seed in (5, 6, 7):
        step, swarm = environment.reset(), Swarm(small(), [seed])
        for recipient in random_recipients(3):
            seen_m = step.observation["position_m"]
            np.testing.assert_array_equal(seen_m, swarm.buffers.position_m[0])
            swarm.step_with_recipients(recipient[None])
            step = environment.step(recipient)


def test_physics_alone_restarts_its_mission():
    physics = make_environment(small(window_s=0.25), seed=4).physics
    start_m = physics.position()
    physics.step(3)
    assert physics.time() == 0.75
    assert np.all(physics.position() != start_m)
    with physics.reset_context():
        pass
    assert physics.time() == 0.0
    np.testing.assert_array_equal(physics.position(), start_m)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ([0, 1, 2, 6, 4, 5], "recipient of robot 3 in mission 0 must be from 0 to 5, not 6"),
        ([0, 1, 2], r"recipient must have shape \(1, 6\), .* not \(1, 3\)"),
    ],
)
def test_impossible_action_is_refused_and_nothing_moves(action, message):
    environment = make_environment(small())
    environment.reset()
    before_m = environment.physics.position()
    with pytest.raises(ValueError, match=message):
        environment.step(action)
    np.testing.assert_array_equal(environment.physics.position(), before_m)
    assert environment.step(range(6)).step_type == StepType.MID


def test_neither_side_writes_the_others_arrays():
    environment = make_environment(small())
    environment.reset()
    recipient = np.array([1, 0, 2, 3, 4, 5])
    kept = environment.step(recipient).observation
    held = {name: array.copy() for name, array in kept.items()}
    recipient[:] = 0
    np.testing.assert_array_equal(
        environment.physics.swarm.phases[0].recipient[0], [1, 0, 2, 3, 4, 5]
    )
    environment.step(range(6))
    for name, array in kept.items():
        np.testing.assert_array_equal(array, held[name])


def test_viewer_flies_it():
    """The viewer's runtime, which needs no window: it makes up actions from the action spec."""
    environment = make_environment(small(num_windows=20))
    viewer = runtime.Runtime(environment)
    errors = []
    viewer.on_error += errors.append
    for _ in range(60):
        viewer.tick(0.1, False)
    assert not errors
    assert viewer.get_time() == pytest.approx(2.0)
    assert viewer.state == runtime.State.STOPPED


# dm_control chooses its OpenGL once, at import, so a picture is taken in a process of its own.
TAKE_PICTURE = """
import sys
import numpy as np
try:
    from dm_control import mujoco
    probe = mujoco.Physics.from_xml_string("<mujoco/>")
    probe.render()
    probe.free()
except Exception as error:
    sys.exit(f"no OpenGL: {error}")
from swarm_mj.envs.dm import make_environment
from swarm_mj.mission import paper
environment = make_environment(paper("random-walk", num_robots=10), seed=1)
environment.reset()
for _ in range(50):
    step = environment.step(range(10))
physics = environment.physics
picture = physics.render(480, 480, camera_id="top")
np.savez(sys.argv[1], picture=picture, position_m=physics.named.data.xpos[1:, :2])
physics.free()
"""


@pytest.fixture(scope="module", params=["egl", pytest.param("osmesa", marks=pytest.mark.slow)])
def photographed(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("picture") / "top.npz"
    command = [sys.executable, "-c", TAKE_PICTURE, str(path)]
    environ = {**os.environ, "MUJOCO_GL": request.param, "PYOPENGL_PLATFORM": request.param}
    done = subprocess.run(command, env=environ, capture_output=True, text=True, check=False)
    if "no OpenGL: " in done.stderr:
        pytest.skip(f"{request.param} does not render here: {done.stderr.strip()[-200:]}")
    assert done.returncode == 0, done.stderr
    return np.load(path)


@pytest.mark.slow
def test_top_camera_sees_the_robots_where_they_are(photographed):
    picture = photographed["picture"].astype(int)
    assert picture.shape == (480, 480, 3)
    # Ten robots on 500 m x 500 m; the camera hangs at 1.3 times that and opens 45 degrees. The
    # beacons' upper side is 1.2 m above the floor.
    pixels_per_m = 240 / (np.tan(np.pi / 8) * (1.3 * 500 - 1.2))
    is_robot = np.zeros((480, 480), dtype=bool)
    row, column = np.indices(is_robot.shape)
    for x_m, y_m in photographed["position_m"]:
        right_m, up_m = (column + 0.5 - 240) / pixels_per_m, (240 - row - 0.5) / pixels_per_m
        distance_m = np.hypot(right_m - x_m, up_m - y_m)
        # A beacon's radius is 8 m, a white hull is at its centre; the floor is below 50.
        assert np.all(picture[distance_m < 6.0, 1] > 120)
        is_robot |= distance_m < 11.0
    assert np.all(picture[~is_robot, 1] - picture[~is_robot, 0] <= 80)  # the beacons are teal


def test_robots_with_bodies_are_shown_as_they_are_turned():
    environment = make_environment(paper("flocking", robot="quadrotor:3,rover:2", num_robots=5))
    environment.reset()
    for _ in range(5):
        step = environment.step(range(5))
    physics = environment.physics
    states = physics.swarm.states
    assert physics.data.qpos.shape == (3 * 7 + 2 * 3,)
    np.testing.assert_allclose(
        physics.data.qpos[:21].reshape(3, 7)[:, :3], states.position_m[0, :3]
    )
    np.testing.assert_allclose(physics.data.qpos[:21].reshape(3, 7)[:, 3:], states.attitude[0, :3])
    assert step.observation["position_m"].shape == (5, 5, 3)
