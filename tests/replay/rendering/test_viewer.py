"""MuJoCo's window, in place of which stands one that keeps what it is shown."""

from contextlib import nullcontext
from types import SimpleNamespace

import mujoco
import pytest
from moments import moment

from swarm_mj.mission import paper

viewer = pytest.importorskip("swarm_mj.replay.rendering.viewer")
MISSION = paper(num_robots=2, density_per_km2=2.0)


@pytest.fixture
def window(monkeypatch):
    empty = mujoco.MjvScene(mujoco.MjModel.from_xml_string("<mujoco/>"), 100)
    shown = SimpleNamespace(user_scn=empty, cam=mujoco.MjvCamera(), opt=mujoco.MjvOption())
    shown.open, shown.syncs = True, 0
    shown.is_running, shown.lock = lambda: shown.open, nullcontext
    shown.sync = lambda: setattr(shown, "syncs", shown.syncs + 1)
    shown.close = lambda: setattr(shown, "open", False)
    monkeypatch.setattr(viewer.glfw, "init", lambda: True)
    monkeypatch.setattr(viewer.viewer, "launch_passive", lambda *_, **__: shown)
    return shown


def test_each_moment_replaces_the_last_until_the_window_is_closed(window):
    seen = viewer.SceneViewer(MISSION)
    for count in (1, 2):
        seen.show(moment([(0.0, 0.0), (50.0, 0.0)]))
        assert (window.user_scn.ngeom, window.syncs) == (2, count)
    seen.close()
    seen.show(moment([(0.0, 0.0), (50.0, 0.0)]))
    assert window.syncs == 2


def test_what_cannot_be_opened_is_told(window, monkeypatch):
    window.user_scn = None
    with pytest.raises(OSError, match="the window was closed before the mission began"):
        viewer.SceneViewer(MISSION)
    monkeypatch.setattr(viewer.glfw, "init", lambda: False)
    with pytest.raises(OSError, match="the window needs a display"):
        viewer.SceneViewer(MISSION)
