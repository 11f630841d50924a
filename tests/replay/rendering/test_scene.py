"""Pictures of the scene, by what is where in them, and the window on it."""

import itertools
from contextlib import nullcontext
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from moments import GREEN, moment
from mujoco import FatalError
from mujoco import mjtGeom as MjtGeom
from scipy import ndimage

from swarm_mj.mission import paper
from swarm_mj.replay.rendering.opengl import make_context
from swarm_mj.replay.rendering.scene import SceneRenderer, SceneViewer

SIZE = 640, 480
pytestmark = pytest.mark.usefixtures("opengl")


def is_of(picture, colour):
    """Pixels of a vivid colour, in light or shade, or behind glass."""
    high, low = np.argmax(colour), np.argmin(colour)
    return picture[..., high].astype(int) - picture[..., low] > 35


def num_blobs(is_set):
    """Connected regions; the edge of a glass wall in front divides none."""
    return ndimage.label(ndimage.binary_dilation(is_set, iterations=2))[1]


@pytest.mark.parametrize("num_robots", [2, 100])
@pytest.mark.parametrize("boundary", ["none", "reflect"])
def test_a_picture_shows_every_robot_once(num_robots, boundary):
    """Robots on a grid, some of them at the walls: none hides another."""
    mission = paper("random-walk", num_robots=num_robots, boundary=boundary)
    steps = np.linspace(-mission.half_side_m, mission.half_side_m, 10)
    where = np.random.default_rng(num_robots).permutation(list(itertools.product(steps, steps)))
    seen = moment(where[:num_robots], reach_m=mission.half_side_m)
    with SceneRenderer(mission, 960, 720) as renderer:
        picture = renderer.frame(seen)
    assert picture.shape == (720, 960, 3)
    assert num_blobs(is_of(picture, GREEN)) == num_robots - 1
    assert num_blobs(picture.min(axis=2) > 110) == 1


def test_robots_stand_where_the_camera_says():
    where = [(-480.0, -480.0), (0.0, 0.0), (480.0, 480.0), (300.0, -200.0)]
    seen = moment(where, observer=3)
    with SceneRenderer(paper("random-walk", num_robots=4, density_per_km2=4.0), *SIZE) as renderer:
        picture, camera = renderer.frame(seen), renderer.camera(seen)
    expected = camera.pixels(np.pad(np.array(where), ((0, 0), (0, 1)), constant_values=6.0))
    blobs, count = ndimage.label(is_of(picture, GREEN))
    found = ndimage.center_of_mass(blobs > 0, blobs, range(1, count + 1))
    seen = sorted((x, y) for y, x in found)
    np.testing.assert_allclose(seen, sorted(map(tuple, expected[:3])), atol=3.0)
    y, x = ndimage.center_of_mass(picture.min(axis=2) > 240)
    np.testing.assert_allclose((x, y), expected[3], atol=5.0)


def test_the_floor_of_an_open_area_follows_its_team():
    """Where the team is, the squares are the same after whole pairs of them."""
    mission = paper(num_robots=2, density_per_km2=2.0)
    away, where = np.array([8000.0, -4000.0]), np.array([(-200.0, 0.0), (200.0, 0.0)])
    near, far = moment(where), moment(where + away)
    far.ground.centre_m[0] = away
    with SceneRenderer(mission, *SIZE) as renderer:
        pictures = [renderer.frame(seen).astype(int) for seen in (near, far)]
    assert np.abs(pictures[0] - pictures[1]).mean() < 1.0
    assert pictures[0][:20].std() > 1.0  # there is floor as far as one sees


def test_what_a_scene_of_one_s_own_adds_is_drawn():
    def with_tower(spec, _mission):
        spec.worldbody.add_geom(
            type=MjtGeom.mjGEOM_BOX, pos=[0, 0, 30], size=[60, 60, 30], rgba=[1, 0, 0, 1]
        )

    def without_floor(spec, _mission):
        spec.delete(spec.geom("floor"))

    mission = paper(num_robots=2, density_per_km2=2.0)
    seen = moment([(-300.0, 0.0), (300.0, 0.0)])
    with SceneRenderer(mission, *SIZE, scene=with_tower) as renderer:
        is_red = is_of(renderer.frame(seen), (255, 0, 0))
        x, y = renderer.camera(seen).pixels(np.array([[0.0, 0.0, 30.0]]))[0]
    assert ndimage.label(is_red)[1] == 1
    assert is_red[round(y), round(x)]
    with SceneRenderer(mission, *SIZE, scene=without_floor) as renderer:
        assert renderer.frame(seen)[:20].std(axis=(0, 1)).max() == 0.0


def test_the_chasing_camera_sees_its_robot_and_the_others_where_it_says():
    """The observer is in the middle, and a green robot 30 m ahead is above it."""
    mission = paper("stationary", num_robots=2)
    seen = moment([(0.0, 0.0), (0.0, 30.0)], reach_m=mission.half_side_m)
    with SceneRenderer(mission, *SIZE, camera="chase") as renderer:
        picture, camera = renderer.frame(seen), renderer.camera(seen)
    (observer, other) = camera.pixels(seen.place_m(0))
    is_ball = ndimage.binary_opening(is_of(picture, GREEN))  # without the stem, which is thin
    y, x = ndimage.center_of_mass(is_ball)
    np.testing.assert_allclose((x, y), other, atol=3.0)
    blobs, _ = ndimage.label(picture.min(axis=2) > 90)
    x, y = observer.round().astype(int)
    assert blobs[y, x] > 0
    assert np.sum(blobs == blobs[y, x]) > 300  # a ball of a metre, 8 m away


def test_two_renderers_do_not_disturb_each_other():
    mission = paper("stationary", num_robots=3)
    seen = moment([(0.0, 0.0), (100.0, 0.0), (0.0, 100.0)], reach_m=mission.half_side_m)
    with SceneRenderer(mission, 320, 240) as first:
        alone = first.frame(seen)
        with SceneRenderer(mission, 64, 64) as second:
            assert second.frame(seen).shape == (64, 64, 3)
        np.testing.assert_array_equal(first.frame(seen), alone)


def test_a_back_end_that_turns_out_not_to_work_is_one_line(monkeypatch):
    def refuse(*_):
        raise FatalError("no context")

    made = []

    def noted(width, height):
        made.append(make_context(width, height))
        freed = made[-1].free
        monkeypatch.setattr(made[-1], "free", lambda: (freed(), made.clear()))
        return made[-1]

    monkeypatch.setattr("swarm_mj.replay.rendering.scene.MjrContext", refuse)
    monkeypatch.setattr("swarm_mj.replay.rendering.scene.make_context", noted)
    with pytest.raises(OSError, match=r"does not work here \(FatalError\); rendering needs OpenGL"):
        SceneRenderer(paper(num_robots=3), 64, 64)
    assert made == []


@pytest.fixture
def window(monkeypatch):
    """In place of MuJoCo's window, one that keeps what it is shown."""
    empty = mujoco.MjvScene(mujoco.MjModel.from_xml_string("<mujoco/>"), 100)
    shown = SimpleNamespace(user_scn=empty, cam=mujoco.MjvCamera(), opt=mujoco.MjvOption())
    shown.open, shown.syncs = True, 0
    shown.is_running, shown.lock = lambda: shown.open, nullcontext
    shown.sync = lambda: setattr(shown, "syncs", shown.syncs + 1)
    shown.close = lambda: setattr(shown, "open", False)
    viewer = pytest.importorskip("mujoco.viewer")
    monkeypatch.setattr("glfw.init", lambda: True)
    monkeypatch.setattr(viewer, "launch_passive", lambda *_, **__: shown)
    return shown


def test_each_moment_replaces_the_last_until_the_window_is_closed(window):
    seen = SceneViewer(paper(num_robots=2))
    for count in (1, 2):
        seen.show(moment([(0.0, 0.0), (50.0, 0.0)]))
        assert (window.user_scn.ngeom, window.syncs) == (2, count)
    seen.close()
    seen.show(moment([(0.0, 0.0), (50.0, 0.0)]))
    assert window.syncs == 2


def test_what_cannot_be_opened_is_told(window, monkeypatch):
    window.user_scn = None
    with pytest.raises(OSError, match="the window was closed before the mission began"):
        SceneViewer(paper(num_robots=2))
    monkeypatch.setattr("glfw.init", lambda: False)
    with pytest.raises(OSError, match="the window needs a display"):
        SceneViewer(paper(num_robots=2))
