"""Live flights: what is refused before them, and what the viewer is asked to play."""

from types import SimpleNamespace

import pytest

import swarm_mj
from swarm_mj.api import live
from swarm_mj.api.live import LiveFlight, check_live
from swarm_mj.mission import paper
from swarm_mj.replay.recorder import Recorder
from swarm_mj.replay.view import LiveViewer
from swarm_mj.simulation.swarm import Swarm

SHORT = {"num_robots": 4, "num_windows": 3}
VIEWER = LiveViewer(process=None, address="rerun+http://127.0.0.1:9/proxy", page=None)


def test_a_speed_is_of_a_live_flight_only():
    with pytest.raises(ValueError, match="--speed 2 is of live flights; add --live"):
        check_live(None, 2.0)
    check_live(None, None)
    check_live("web", 2.0)


def test_without_rerun_there_is_nothing_live(monkeypatch):
    def lacks(*named):
        raise ModuleNotFoundError(" ".join(named))

    monkeypatch.setattr(live, "need", lacks)
    with pytest.raises(ModuleNotFoundError, match=r"a live replay .*leave out --live"):
        check_live("web", None)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"live": "browser"}, "live must be True or \"web\", not 'browser'"),
        ({"live": "web", "record": False}, "leave out record=False"),
        ({"speed": 1.0}, "speed=1 is of live flights; add live=True"),
        ({"live": "web", "speed": 0.0}, "speed must be above 0, not 0"),
    ],
)
def test_arguments_that_do_not_go_together_are_refused(keywords, message):
    with pytest.raises(ValueError, match=message):
        swarm_mj.fly("random-walk", policy="tdma", **SHORT, **keywords)


def test_python_shows_its_flight_in_a_viewer_that_stays(monkeypatch):
    seen = []

    class Shown:
        def __init__(self, _recorder, _config, name, address, **how):
            seen.append((name, address, how["windows_per_second"]))

        def show(self):
            seen.append("window")

        def finish(self):
            seen.append("end")

    monkeypatch.setattr(live._kept_open, "enter_context", lambda _: VIEWER)
    monkeypatch.setattr("swarm_mj.replay.live.LiveReplay", Shown)
    run = swarm_mj.fly("random-walk", policy="tdma", live="web", speed=50.0, **SHORT)
    begun = ("tdma, seed 1", VIEWER.address, 500.0)  # windows of 0.1 s
    assert seen == [begun, *["window"] * 3, "end"]
    assert len(run.log.window) == 3


def test_as_fast_as_it_goes_the_viewer_shows_the_latest_window(monkeypatch):
    made = SimpleNamespace(played="unknown")

    def replay(*_, windows_per_second, **__):
        made.played = windows_per_second

    monkeypatch.setattr("swarm_mj.replay.live.LiveReplay", replay)
    recorder = Recorder(Swarm(paper(num_robots=4), [1]))
    LiveFlight(VIEWER, "a").begin(recorder, {"window_s": 0.1})
    assert made.played is None
