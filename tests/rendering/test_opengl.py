"""Which back end draws, and what is said where none does."""

import sys

import pytest

from swarm_mj.cli import main
from swarm_mj.rendering import opengl


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
    monkeypatch.setattr(opengl, "_works", lambda _: egl_works)
    assert opengl.backend() == name


@pytest.mark.skipif(sys.platform == "darwin", reason="Apple's own back end needs no choice")
def test_what_pyopengl_was_told_already_binds(monkeypatch):
    monkeypatch.setenv("PYOPENGL_PLATFORM", "osmesa")
    monkeypatch.setattr(opengl, "_works", lambda _: pytest.fail("asked nobody"))
    assert opengl.backend() == "osmesa"


def test_a_trial_that_fails_is_quiet(capfd):
    assert not opengl._works("raise ImportError('no driver')")
    assert opengl._works("pass")
    assert capfd.readouterr() == ("", "")


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
