"""Replays are opened if they are whole: in a window, or to a browser on this machine."""

import pytest

from swarm_mj.cli import main, replay


def test_replay_refuses_what_is_no_whole_replay(swarm_mj, tmp_path):
    swarm_mj("fly", "--windows", 5, "--record", "whole.rrd")
    whole = (tmp_path / "whole.rrd").read_bytes()
    (tmp_path / "cut.rrd").write_bytes(whole[: len(whole) // 2])
    for name in ("cut.rrd", "missing.rrd"):
        for web in ([], ["--web"]):
            done = swarm_mj("replay", name, *web)
            assert done.returncode == 2
            assert name in done.stderr
            assert len(done.stderr.strip().splitlines()) == 1


@pytest.fixture
def opened(monkeypatch):
    """The commands that viewers were run by; each viewer ends with 3."""
    commands = []

    def run(command):
        commands.append(command)
        return 3

    monkeypatch.setattr("swarm_mj.replay.read.check_replay", lambda _: None)
    monkeypatch.setattr(replay, "run_viewer", run)
    return commands


def test_replay_opens_a_window_and_ends_as_the_viewer_does(opened, monkeypatch, capsys):
    monkeypatch.setenv("DISPLAY", ":0")
    assert main(["replay", "some.rrd"]) == 3
    assert opened[0][-1] == "some.rrd"
    assert "--serve-web" not in opened[0]
    assert capsys.readouterr().out == ""


def test_replay_serves_a_browser_on_request_and_says_where(opened, capsys):
    assert main(["replay", "some.rrd", "--web"]) == 3
    assert "--serve-web" in opened[0]
    address, end = capsys.readouterr().out.splitlines()
    port = opened[0][opened[0].index("--web-viewer-port") + 1]
    assert address.startswith(f"Open http://127.0.0.1:{port}/")
    assert end == "Ctrl-C ends it."
