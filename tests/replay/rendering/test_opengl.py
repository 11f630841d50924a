"""Which back end draws, and what is said where none does."""

import os
import sys
from types import SimpleNamespace

import pytest

from swarm_mj.cli import main
from swarm_mj.replay.rendering import opengl

not_on_macos = pytest.mark.skipif(
    sys.platform == "darwin", reason="Apple's own back end needs no choice"
)


@pytest.fixture(autouse=True)
def _fresh(monkeypatch):
    monkeypatch.setenv(opengl.CHOICE, "")
    monkeypatch.delenv(opengl.PYOPENGL, raising=False)
    monkeypatch.delitem(sys.modules, "OpenGL.platform", raising=False)


@pytest.mark.parametrize(
    ("chosen", "name"), [("osmesa", "osmesa"), ("EGL ", "egl"), ("glfw", "glfw"), ("glx", "glfw")]
)
def test_a_user_s_choice_is_kept(monkeypatch, chosen, name):
    monkeypatch.setenv(opengl.CHOICE, chosen)
    monkeypatch.setattr(opengl, "_works", lambda _: pytest.fail("asked nobody"))
    assert opengl.backend() == name


@not_on_macos
@pytest.mark.parametrize(
    ("preset", "working", "name"),
    [
        ("", "egl osmesa", "egl"),
        ("", "osmesa", "osmesa"),
        ("osmesa", "egl osmesa", "osmesa"),  # what PyOpenGL was given binds if it works
        ("egl", "egl osmesa", "egl"),
        ("osmesa", "egl", "egl"),
        ("egl", "osmesa", "osmesa"),
    ],
)
def test_without_one_the_first_that_works_is_taken_once(monkeypatch, preset, working, name):
    asked = []
    monkeypatch.setenv(opengl.PYOPENGL, preset)
    monkeypatch.setattr(opengl, "_works", lambda each: asked.append(each) or each in working)
    assert [opengl.backend(), opengl.backend()] == [name, name]
    assert (asked[-1], len(asked)) == (name, len(set(asked)))
    assert os.environ[opengl.CHOICE] == name
    assert os.environ.get(opengl.PYOPENGL, name) in ("", name)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="GLX is X's")
@pytest.mark.parametrize(("loaded", "other"), [("GLX", "egl"), ("EGL", "osmesa")])
def test_what_pyopengl_has_loaded_binds(monkeypatch, loaded, other):
    """dm_control's viewer loads GLX: EGL then finds no display, although a fresh process does."""
    platform = SimpleNamespace(PLATFORM=type(f"{loaded}Platform", (), {})())
    monkeypatch.setitem(sys.modules, "OpenGL.platform", platform)
    monkeypatch.setattr(opengl, "_works", lambda name: name == other)
    chosen = loaded.lower()
    with pytest.raises(OSError, match=f"has chosen {chosen}, .* set MUJOCO_GL={other} before"):
        opengl.backend()


@pytest.mark.parametrize(("trial", "works"), [("raise ImportError('{}')", False), ("'{}'", True)])
def test_a_trial_is_quiet_and_runs_nothing_of_the_folder_here(
    monkeypatch, capfd, trapped, trial, works
):
    monkeypatch.setattr(opengl, "TRIAL", f"import numpy; {trial}")
    assert opengl._works("no driver") == works
    assert capfd.readouterr() == ("", "")
    assert not trapped.exists()


def test_where_none_works_nothing_is_chosen(monkeypatch):
    """For MuJoCo cannot be imported with a back end that is not there."""
    monkeypatch.setattr(opengl, "_works", lambda _: False)
    monkeypatch.setattr(sys, "platform", "linux")
    with pytest.raises(OSError, match=r"neither EGL nor OSMesa works here; .*apt-get install"):
        opengl.backend()
    assert os.environ[opengl.CHOICE] == ""


@pytest.mark.parametrize(
    ("chosen", "reason"),
    [
        ("wgl", r"wgl does not work here .*apt-get install"),
        ("off", "MUJOCO_GL=off switches rendering off"),
    ],
)
def test_no_opengl_is_one_line_with_the_way_out(monkeypatch, chosen, reason):
    monkeypatch.setenv(opengl.CHOICE, chosen)
    with pytest.raises(OSError, match=reason) as refused:
        opengl.make_context(8, 8)
    assert "\n" not in str(refused.value)


def test_a_back_end_that_does_not_exist_is_told_before_mujoco_is_loaded(monkeypatch, capsys):
    monkeypatch.setenv(opengl.CHOICE, "bogus")
    assert main(["fly", "--no-record"]) == 2
    said = capsys.readouterr().err
    assert "MUJOCO_GL must be one of egl, osmesa" in said
    assert "not 'bogus'; unset it" in said
    assert said.count("\n") == 1
