"""What the machine has, as the doctor says it."""

import pytest

from swarm_mj.cli.health import machine as looked_at
from swarm_mj.cli.health.machine import machine
from swarm_mj.radio import reception


def found():
    return {each.name: each for each in machine()}


def test_little_room_is_told(monkeypatch):
    monkeypatch.setattr(looked_at, "free_memory", lambda: 10**9)
    monkeypatch.setattr(looked_at, "free_room", lambda _: 5 * 10**9)
    assert found()["memory free"].state == "absent"
    assert found()["memory free"].found == "1 GB, less than 2 GB"
    assert found()["disk free here"] == (
        "room",
        "disk free here",
        "ok",
        "5 GB",
        "name another folder",
    )


@pytest.mark.parametrize("name", ["DISPLAY", "WAYLAND_DISPLAY"])
def test_a_display_is_one_of_two(monkeypatch, name):
    for each in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(each, raising=False)
    monkeypatch.setattr(looked_at.sys, "platform", "linux")
    assert "--web" in found()["display"].mend
    monkeypatch.setenv(name, ":1")
    assert found()["display"].found == f"{name}=:1"


def test_compiled_code_needs_a_place_that_can_be_written(monkeypatch, tmp_path):
    class Kernel:
        class stats:  # noqa: N801 - numba's name
            cache_path = str(tmp_path)

    monkeypatch.setattr(reception, "sinr", Kernel)
    assert found()["compiled code"].found == f"kept in {tmp_path}"
    assert not list(tmp_path.iterdir())
    (tmp_path / "file").touch()
    Kernel.stats.cache_path = str(tmp_path / "file" / "folder")
    assert "cannot be written" in found()["compiled code"].found
    Kernel.stats.cache_path = None
    assert found()["compiled code"].state == "absent"
    assert "NUMBA_CACHE_DIR" in found()["compiled code"].mend
