"""Which back end draws, and what is said where none does."""

import os
import sys
from types import SimpleNamespace

import pytest

from swarm_mj.cli import main
from swarm_mj.replay.rendering import opengl


@pytest.fixture(autouse=True)
def _fresh(monkeypatch):
    monkeypatch.setenv(opengl.CHOICE, "")
    monkeypatch.delenv("PYOPENGL_PLATFORM", raising=False)
    monkeypatch.delitem(sys.modules, "OpenGL.platform", raising=False)


@pytest.mark.parametrize(
    ("chosen", "name"), [("osmesa", "osmesa"), ("EGL ", "egl"), ("glfw", "glfw"), ("glx", "glfw")]
)
def test_a_user_s_choice_is_kept(monkeypatch, chosen, name):
    monkeypatch.setenv(opengl.CHOICE, chosen)
    monkeypatch.setattr(opengl, "_works", lambda _: pytest.fail("asked nobody"))
    assert opengl.backend() == name


@pytest.mark.skipif(sys.platform == "darwin", reason="Apple's own back end needs no choice")
@pytest.mark.parametrize(("egl_works", "name"), [(True, "egl"), (False, "osmesa")])
def test_without_one_the_first_that_works_is_taken(monkeypatch, egl_works, name):
    monkeypatch.setattr(opengl, "_works", lambda name: egl_works or name == "osmesa")
    assert opengl.backend() == name


@pytest.mark.skipif(sys.platform == "darwin", reason="Apple's own back end needs no choice")
@pytest.mark.parametrize("preset", ["osmesa", "egl"])
def test_what_pyopengl_was_told_already_binds_if_it_works(monkeypatch, preset):
    monkeypatch.setenv(opengl.PYOPENGL, preset)
    monkeypatch.setattr(opengl, "_works", lambda name: name == preset)
    assert opengl.backend() == preset


@pytest.mark.skipif(sys.platform == "darwin", reason="Apple's own back end needs no choice")
@pytest.mark.parametrize(("preset", "other"), [("osmesa", "egl"), ("egl", "osmesa")])
def test_what_pyopengl_was_told_does_not_bind_if_it_does_not_work(monkeypatch, preset, other):
    monkeypatch.setattr(opengl, "_works", lambda name: name == other)
    monkeypatch.setenv(opengl.PYOPENGL, preset)
    assert opengl.backend() == other
    assert opengl.PYOPENGL not in os.environ


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


@pytest.mark.skipif(sys.platform == "darwin", reason="Apple's own back end needs no choice")
def test_it_is_decided_once_for_all_libraries_and_processes(monkeypatch):
    asked = []
    monkeypatch.setattr(opengl, "_works", lambda name: bool(asked.append(name)) or name == "osmesa")
    assert [opengl.backend(), opengl.backend()] == ["osmesa", "osmesa"]
    assert asked == ["egl", "osmesa"]
    assert os.environ[opengl.CHOICE] == "osmesa"


def test_where_none_works_nothing_is_chosen(monkeypatch):
    """For MuJoCo cannot be imported with a back end that is not there."""
    monkeypatch.setattr(opengl, "_works", lambda _: False)
    monkeypatch.setattr(sys, "platform", "linux")
    with pytest.raises(OSError, match=r"neither EGL nor OSMesa works here; .*apt-get install"):
        opengl.backend()
    assert os.environ[opengl.CHOICE] == ""


def test_no_opengl_is_one_line_with_the_way_out(monkeypatch):
    monkeypatch.setenv(opengl.CHOICE, "wgl")
    with pytest.raises(OSError, match=r"wgl does not work here .*apt-get install") as refused:
        opengl.make_context(8, 8)
    assert "\n" not in str(refused.value)


def test_rendering_that_is_switched_off_says_so(monkeypatch):
    monkeypatch.setenv(opengl.CHOICE, "off")
    with pytest.raises(OSError, match="MUJOCO_GL=off switches rendering off"):
        opengl.backend()


def test_a_back_end_that_does_not_exist_is_told_before_mujoco_is_loaded(monkeypatch, capsys):
    monkeypatch.setenv(opengl.CHOICE, "bogus")
    assert main(["fly", "--no-record"]) == 2
    said = capsys.readouterr().err
    assert "MUJOCO_GL must be one of egl, osmesa" in said
    assert "not 'bogus'; unset it" in said
    assert said.count("\n") == 1
