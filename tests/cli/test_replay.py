"""Replays are opened if they are whole: in a window, or to a browser on this machine."""

import pytest

from swarm_mj.cli import main, replay


@pytest.mark.parametrize(("name", "web"), [("cut.rrd", []), ("missing.rrd", ["--web"])])
def test_replay_refuses_what_is_no_whole_replay(here, capsys, name, web):
    (here / "cut.rrd").write_bytes(b"RRF2")
    assert main(["replay", name, *web]) == 2
    said = capsys.readouterr().err
    assert name in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("web", [False, True])
def test_replay_opens_a_window_or_says_where_a_browser_goes(web, monkeypatch, capsys):
    """The viewer ends with 3, and so does the command."""
    opened = []
    monkeypatch.setattr("swarm_mj.replay.read.check_replay", lambda _: None)
    monkeypatch.setattr(replay.view, "run", lambda command: opened.append(command) or 3)
    monkeypatch.setenv("DISPLAY", ":0")
    assert main(["replay", "some.rrd", *(["--web"] if web else [])]) == 3
    (command,), said = opened, capsys.readouterr().out
    assert command[-1] == "some.rrd"
    assert ("--serve-web" in command) == web
    if not web:
        assert said == ""
        return
    address, end = said.splitlines()
    port = command[command.index("--web-viewer-port") + 1]
    assert address.startswith(f"Open http://127.0.0.1:{port}/")
    assert end == "Ctrl-C ends it."
