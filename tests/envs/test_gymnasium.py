import os
import shutil
import subprocess
import sys
import warnings
from dataclasses import replace
from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import TimeAwareObservation
from scanners import SCANNERS

from swarm_mj.envs import register_environments
from swarm_mj.envs.gymnasium import HEIGHT, WIDTH, Screen, SwarmEnv
from swarm_mj.envs.gymnasium_vector import SwarmVectorEnv
from swarm_mj.envs.pettingzoo import parallel_env
from swarm_mj.mission import paper
from swarm_mj.replay.recorder import moment
from swarm_mj.replay.rendering.scene import SceneRenderer
from swarm_mj.simulation.swarm import Swarm

SMALL = {"num_robots": 5, "num_windows": 8, "range_ratio": 0.4}


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("Stationary", {}),
        ("RandomWalk", {"features": "paper", "with_parents": True}),
        ("Flocking", {"preset": "reference", "features": "reference"}),
        ("Flocking", {"robot": "quadrotor"}),
        ("RandomWalk", {"with_sensors": True, **SCANNERS}),
    ],
)
@pytest.mark.usefixtures("opengl")
def test_gymnasiums_own_check(name, options, monkeypatch):
    for display in ("DISPLAY", "WAYLAND_DISPLAY"):  # where the check would open a window
        monkeypatch.delenv(display, raising=False)
    register_environments()
    env = gymnasium.make(f"swarm_mj/{name}-v0", **SMALL, **options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)


def test_render_modes_are_those_that_work_here(monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    for modes, display in ((["rgb_array"], ""), (["rgb_array", "human"], ":0")):
        monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
        monkeypatch.setenv("DISPLAY", display)
        for env in (SwarmEnv(**SMALL), parallel_env(**SMALL)):
            assert env.metadata["render_modes"] == modes


def test_videos_last_as_long_as_the_mission():
    for env in (SwarmEnv, parallel_env, partial(SwarmVectorEnv, 2)):
        assert env(**SMALL).metadata["render_fps"] == 10
        assert env(window_s=0.25, **SMALL).metadata["render_fps"] == 4


def test_its_specification_says_when_a_mission_is_cut_off():
    register_environments()
    env = gymnasium.make("swarm_mj/Flocking-v0", **SMALL)
    assert env.spec.max_episode_steps == 8
    timed = TimeAwareObservation(env, flatten=False, normalize_time=True)
    timed.reset(seed=1)
    for window in range(8):
        seen, _, _, truncated, _ = timed.step(np.arange(5))
        assert seen["time"] == np.float32((window + 1) / 8)
        assert truncated == (window == 7)
    again = gymnasium.make(env.spec)
    assert again.spec.kwargs == env.spec.kwargs
    assert gymnasium.spec("swarm_mj/Flocking-v0").max_episode_steps is None  # of another length


START_ELSEWHERE = """
import gymnasium
def make():
    return gymnasium.make("swarm_mj:swarm_mj/Flocking-v0", num_robots=3, num_windows=2)
if __name__ == "__main__":
    envs = gymnasium.vector.AsyncVectorEnv([make, make], context={context!r})
    _, infos = envs.reset(seed=4)
    print(infos["seed"].tolist(), envs.step(envs.action_space.sample())[1].shape)
    envs.close()
"""


@pytest.mark.slow
@pytest.mark.parametrize("context", ["spawn", "forkserver"])
def test_processes_that_start_anew_import_it_by_its_name(context, tmp_path):
    """No file but this one names the package; the processes have not imported it."""
    script = tmp_path / "elsewhere.py"
    script.write_text(START_ELSEWHERE.format(context=context))
    command = [sys.executable, "-W", "ignore", str(script)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout == "[4, 5] (2,)\n", done.stderr


def test_unknown_options_are_refused_in_pythons_words():
    """TorchRL's `GymEnv` tries `frameskip`, and goes on without it if it reads these words."""
    register_environments()
    with pytest.raises(TypeError, match="unexpected keyword argument 'frameskip'"):
        gymnasium.make("swarm_mj/Flocking-v0", frameskip=1)


def test_info_is_what_the_window_cost():
    env, swarm = SwarmEnv("random-walk", **SMALL), Swarm(paper("random-walk", **SMALL), [4])
    start = env.reset(seed=4)[1]
    assert start.pop("seed") == 4
    variance = np.var(swarm.states.velocity_mps[0], axis=0).sum()
    assert start.pop("velocity_variance_m2ps2") == pytest.approx(variance)
    assert not any(start.values())  # no age, no packets
    for recipient in np.random.default_rng(1).integers(0, 5, (8, 5)):
        *_, info = env.step(recipient)
        costs = swarm.step_with_recipients(recipient[None])
        counts = ("sent", "delivered", "lost", "overheard", "answered")
        expected = {f"packets_{name}": getattr(costs.packets, name)[0] for name in counts}
        for name in ("age_windows", "velocity_variance_m2ps2", "is_complete"):
            expected[name] = getattr(costs, name)[0]
        assert info == {"seed": 4, **expected}


def test_a_mission_may_be_given_whole_and_changed():
    mission, changes = paper("flocking", **SMALL), {"task": "random-walk", "num_robots": 3}
    assert SwarmEnv(mission, **changes).batch.mission == replace(mission, **changes)


# Pictures: of the right mission, at the right moment.

MISSION = paper("random-walk", num_robots=6, range_ratio=0.4, num_windows=9)


def recipients(num_windows):
    return np.random.default_rng(1).integers(0, 6, (num_windows, 2, 6))


@pytest.fixture(scope="module")
def pictures():
    """Of the missions of seeds 3 and 4 after each window, drawn without any environment."""
    swarm = Swarm(MISSION, [3, 4])
    with SceneRenderer(MISSION, WIDTH, HEIGHT) as renderer:
        drawn = [[renderer.frame(moment(swarm, b)) for b in (0, 1)]]
        for recipient in recipients(5):
            swarm.step_with_recipients(recipient)
            drawn.append([renderer.frame(moment(swarm, b)) for b in (0, 1)])
    return drawn


@pytest.mark.slow
@pytest.mark.usefixtures("opengl")
def test_single_environments_are_drawn(pictures):
    assert len({picture.tobytes() for pair in pictures for picture in pair}) == 12
    env = SwarmEnv(MISSION, render_mode="rgb_array")
    env.reset(seed=3)
    for recipient, pair in zip(recipients(5), pictures[1:], strict=True):
        env.step(recipient[0])
        np.testing.assert_array_equal(env.render(), pair[0])
    env.close()
    env = parallel_env(MISSION, render_mode="rgb_array")
    env.reset(seed=4)
    np.testing.assert_array_equal(env.render(), pictures[0][1])
    env.close()


@pytest.mark.usefixtures("opengl")
def test_every_mission_of_a_vector_is_drawn(pictures):
    """Also of those that began later than the others."""
    env = SwarmVectorEnv(3, MISSION, render_mode="rgb_array")
    env.reset(seed=[3, 4, 5])
    for recipient in recipients(2):
        env.step(np.concatenate([recipient, recipient[:1]]))
    env.reset(seed=[None, 4, None], options={"reset_mask": np.array([False, True, False])})
    drawn = env.render()
    assert len(drawn) == 3
    np.testing.assert_array_equal(drawn[0], pictures[2][0])
    np.testing.assert_array_equal(drawn[1], pictures[0][1])
    env.close()


def test_without_a_mode_there_is_no_picture():
    for env in (SwarmEnv(MISSION), parallel_env(MISSION), SwarmVectorEnv(2, MISSION)):
        env.reset(seed=1)
        assert env.render() is None
        env.close()


def test_a_mode_that_there_is_not():
    with pytest.raises(ValueError, match="render_mode must be one of rgb_array, human, not 'ansi'"):
        Screen("ansi")
    with pytest.raises(ValueError, match="render_mode must be one of rgb_array, not 'human'"):
        SwarmVectorEnv(2, MISSION, render_mode="human")


DRAW_AND_END = """
import gymnasium, swarm_mj
env = gymnasium.make("swarm_mj/Flocking-v0", num_robots=3, render_mode="rgb_array")
env.reset(seed=1)
print(env.render().shape)
"""


@pytest.mark.slow
@pytest.mark.usefixtures("opengl")
def test_a_script_that_closes_nothing_ends_quietly():
    command = [sys.executable, "-W", "ignore", "-c", DRAW_AND_END]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "(600, 800, 3)\n", "")


# In a process of its own: a window belongs to the process, and to its display.
FLY_BEFORE_A_HUMAN = """
import time
import gymnasium, swarm_mj
import numpy as np
env = gymnasium.make("swarm_mj/Flocking-v0", num_robots=5, num_windows=9, render_mode="human")
env.reset(seed=1)
started = time.monotonic()
for _ in range(8):
    env.step(np.arange(5))
assert time.monotonic() - started > 0.7, "faster than time"
viewer = env.unwrapped._screen._viewer
assert viewer._window.is_running()
assert viewer._markers.ngeom == 10, viewer._markers.ngeom  # five discs with headings
env.close()
assert not viewer._window.is_running()
print("seen")
"""


def fly_before_a_human(*program, **environment):
    command = [*program, sys.executable, "-W", "ignore", "-c", FLY_BEFORE_A_HUMAN]
    environ = {k: v for k, v in os.environ.items() if k != "DISPLAY"} | environment
    return subprocess.run(command, env=environ, capture_output=True, text=True, check=False)


@pytest.mark.usefixtures("opengl")
@pytest.mark.skipif(shutil.which("xvfb-run") is None, reason="needs Xvfb, a display without one")
def test_a_human_sees_a_mission_in_a_window():
    done = fly_before_a_human("xvfb-run", "-a")
    assert (done.returncode, done.stdout) == (0, "seen\n"), done.stderr


@pytest.mark.slow
@pytest.mark.usefixtures("opengl")
@pytest.mark.skipif(sys.platform != "linux", reason="other systems have a display always")
def test_without_a_display_it_says_so():
    done = fly_before_a_human()
    last = done.stderr.strip().splitlines()[-1]
    assert last == (
        'OSError: the window needs a display; without one, render_mode="rgb_array" draws pictures'
    )
