"""Which back end draws, and what is said where none does."""

import os
import sys

import pytest

from swarm_mj.cli import main
from swarm_mj.replay.rendering import opengl


@pytest.fixture(autouse=True)
def _fresh(monkeypatch):
    monkeypatch.setenv(opengl.CHOICE, "")
    monkeypatch.delenv("PYOPENGL_PLATFORM", raising=False)
    opengl._default.cache_clear()
    yield
    opengl._default.cache_clear()


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
def test_what_does_not_work_binds_only_if_pyopengl_has_settled_on_it(monkeypatch, preset, other):
    monkeypatch.setattr(opengl, "_works", lambda name: name == other)
    monkeypatch.setenv(opengl.PYOPENGL, preset)
    monkeypatch.setitem(sys.modules, "OpenGL.platform", sys)
    with pytest.raises(OSError, match=f"has chosen {preset}, .* set MUJOCO_GL={other} before"):
        opengl.backend()
    monkeypatch.delitem(sys.modules, "OpenGL.platform")
    assert opengl.backend() == other
    assert opengl.PYOPENGL not in os.environ


@pytest.mark.parametrize(("trial", "works"), [("raise ImportError('{}')", False), ("'{}'", True)])
def test_a_trial_is_quiet_and_runs_nothing_of_the_folder_here(
    monkeypatch, capfd, trapped, trial, works
):
    monkeypatch.setattr(opengl, "TRIAL", f"import numpy; {trial}")
    assert opengl._works("no driver") == works
    assert capfd.readouterr() == ("", "")
    assert not trapped.exists()


@pytest.mark.parametrize("before", ["", "osmesa"])
def test_mujoco_alone_is_told_the_back_end(monkeypatch, before):
    monkeypatch.setattr(opengl, "backend", lambda: "osmesa")
    monkeypatch.setenv(opengl.CHOICE, before)
    with opengl.chosen():
        assert os.environ[opengl.CHOICE] == "osmesa"
    assert os.environ[opengl.CHOICE] == before
    monkeypatch.delenv(opengl.CHOICE)
    with pytest.raises(KeyError), opengl.chosen():
        raise KeyError
    assert opengl.CHOICE not in os.environ


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
