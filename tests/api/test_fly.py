"""Python flies what the command line flies, to the last digit."""

import json
import math
import signal
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import swarm_mj
from swarm_mj.api import flight
from swarm_mj.cli import main
from swarm_mj.mission import paper
from swarm_mj.policies.policy import DecentralisedPolicy
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.packages import asset

SHORT = {"num_robots": 6, "num_windows": 20, "range_ratio": 0.5}
OPTIONS = ("--robots", "6", "--windows", "20", "--range-ratio", "0.5")


class Silent(DecentralisedPolicy):
    """Nobody ever transmits."""

    def recipients(self, views):
        return views.silence


OWN = """
import numpy as np
from swarm_mj.policies.tdma import Tdma as Mine
def deaf(position_m, recipient):
    return np.broadcast_to(np.arange(recipient.shape[1]), recipient.shape).copy()
"""


@pytest.mark.parametrize(
    ("keywords", "options"),
    [
        ({"policy": "planner"}, ()),
        (
            {"policy": "own_fly_parts:Mine", "channel": "own_fly_parts:deaf"},
            ("--policy", "own_fly_parts:Mine", "--channel", "own_fly_parts:deaf"),
        ),
        ({"task": "random-walk", "policy": "mst", "seed": 7}, ("--policy", "mst", "--seed", "7")),
        (
            {"task": "stationary", "policy": "aloha", "probability": 0.2, "preset": "reference"},
            ("--policy", "aloha", "--probability", "0.2", "--preset", "reference"),
        ),
        ({"failure_fraction": 0.3, "record": False}, ("--failure-fraction", "0.3")),
    ],
)
def test_it_is_what_the_command_line_flies(here, keywords, options):
    (here / "own_fly_parts.py").write_text(OWN)
    run = swarm_mj.fly(**(SHORT | keywords))
    task = keywords.get("task", "flocking")
    line = ["fly", "--task", task, *OPTIONS, *options]
    assert main([*line, "--no-record", "--json", "told.json"]) == 0
    told = json.loads((here / "told.json").read_text())
    run.save("ours.json")
    ours = json.loads((here / "ours.json").read_text())
    assert ours.keys() == told.keys()
    del ours["wall_seconds"], told["wall_seconds"]
    assert ours == told
    assert (run.summary.packets_heard == 0) == ("channel" in keywords)


NUMPYS = """
import numpy as np
import swarm_mj
seed, observer = np.arange(8)[[7, 2]]
short = {"num_robots": np.int16(6), "num_windows": 4, "range_ratio": np.float32(0.5)}
swarm_mj.fly(policy="tdma", seed=seed, observer=observer, **short).save("a.json")
swarm_mj.evaluate("tdma", num_missions=np.int32(2), seed=seed, **short).save("b.json")
"""


@pytest.mark.parametrize("failure_fraction", [0.0, 0.4])
def test_the_share_heard_is_that_of_the_pairs_of_active_robots(failure_fraction):
    mission = paper("stationary", num_robots=9, num_windows=2, failure_fraction=failure_fraction)
    swarm = Swarm(mission, [3])
    list(rollout(swarm, make_policy("tdma", mission)))
    on = swarm.states.is_active
    active = range(9) if on is None else np.flatnonzero(on[0]).tolist()
    heard = [swarm.buffers.timestamp[0, i, j] > NEVER for i in active for j in active if i != j]
    flown = swarm_mj.fly(mission, policy="tdma", seed=3, record=False)
    assert 0.0 < flown.summary.heard_share < 1.0
    assert flown.summary.heard_share == pytest.approx(np.mean(heard))


def test_robots_out_of_everyone_s_range_at_the_end_are_counted():
    """Who hears nothing keeps the velocity that it began with."""
    mission = paper("flocking", num_robots=4, num_windows=3000, range_ratio=0.2)
    talking = swarm_mj.fly(mission, policy="tdma", record=False)
    assert talking.summary.strayed == 0
    silent = swarm_mj.fly(mission, policy="aloha", probability=0.0, record=False)
    assert silent.summary.strayed == 4


def test_a_flight_says_the_energy_of_bodies_alone(tmp_path):
    """Hover with 56.4 W each, for 2 s; a model that declares no efficiency does not say."""
    flown = {"num_robots": 3, "num_windows": 20, "policy": "tdma", "record": False}
    hovering = swarm_mj.fly("stationary", robot="quadrotor", **flown).summary
    assert hovering.energy_mean_j == pytest.approx(2.0 * 56.4, rel=1e-3)
    assert hovering.energy_worst_j == pytest.approx(hovering.energy_mean_j)
    silent = tmp_path / "silent.xml"
    text = asset("rover.xml").read_text()
    silent.write_text(text.replace('<numeric name="efficiency" data="1"/>', ""))
    pilot = "swarm_mj.physics.pilots:RoverPilot"
    driving = swarm_mj.fly("stationary", robot=str(silent), pilot=pilot, **flown).summary
    points = swarm_mj.fly("stationary", **flown).summary
    for its in (driving, points):
        assert (its.energy_mean_j, its.energy_worst_j) == (None, None)


@pytest.mark.slow
def test_numpys_numbers_can_be_saved(here):
    """In a Python without the tests' checks of types, which admit Python's numbers only."""
    subprocess.run([sys.executable, "-c", NUMPYS], check=True, cwd=here)
    config = json.loads((here / "a.json").read_text())["config"]
    names = ("seed", "observer", "num_robots", "range_ratio")
    assert [config[name] for name in names] == [7, 2, 6, 0.5]
    (result,) = json.loads((here / "b.json").read_text())["results"]
    assert (result["episodes"], result["seed"]) == (2, 7)


def test_a_mission_and_a_policy_of_ones_own_fly():
    mission = paper("stationary", **SHORT)
    run = swarm_mj.fly(mission, policy=Silent(), record=False)
    assert run.mission is mission
    assert run.config["policy"] == "Silent"
    # Nobody speaks, so after w windows each pair but one's own is w old: on average 10.5.
    assert run.summary.aoi_mean == pytest.approx(10.5 * 5 / 6)


def test_ctrl_c_keeps_what_was_flown(monkeypatch):
    windows = flight.rollout

    def pressed(*arguments):
        for count, window in enumerate(windows(*arguments), start=1):
            if count == 5:
                signal.raise_signal(signal.SIGINT)
            yield window

    monkeypatch.setattr(flight, "compile_ahead", lambda *_, **__: None)
    monkeypatch.setattr(flight, "rollout", pressed)
    with pytest.warns(UserWarning, match="Interrupted after 5 of 20 windows; these are kept"):
        run = swarm_mj.fly(**SHORT)
    assert run.summary.interrupted is True
    assert run.summary.num_windows == len(run.windows) == len(run.log.window) == 5
    assert math.isfinite(run.summary.aoi_mean)


def test_compiling_is_not_timed(monkeypatch):
    """By a clock that moves when the small mission is flown ahead, and at no other time."""
    now_s, flown = [0.0], []

    def compile_slowly(mission, name, arguments):
        flown.append((mission.task, name, arguments.probability))
        now_s[0] += 20.0

    monkeypatch.setattr(flight, "time", SimpleNamespace(perf_counter=lambda: now_s[0]))
    monkeypatch.setattr(flight, "compile_ahead", compile_slowly)
    for policy in ("mst", Silent()):
        assert swarm_mj.fly(policy=policy, record=False, **SHORT).summary.wall_seconds == 0.0
    assert flown == [("flocking", "mst", None), ("flocking", "Silent", None)]


@pytest.mark.parametrize(
    ("keywords", "complaint"),
    [
        (
            {"num_robot": 20},
            "swarm_mj.fly got an unexpected keyword argument 'num_robot'; did you mean num_robots?",
        ),
        ({"policy": "tdmaa"}, "not 'tdmaa'; did you mean tdma?"),
        ({"features": "mine:Feat"}, "was trained on the features mine:Feat; leave them out"),
        ({"seed": -1}, "seeds must be one or more integers from 0"),
        ({"observer": 6}, "observer must be from 0 to 5, not 6"),
        ({"policy": "tdma", "probability": 0.5}, "tdma takes no transmission probability"),
        ({"policy": Silent(), "probability": 0.5}, "change policies by name"),
        ({"task": paper(), "num_robots": 6}, "of it: dataclasses.replace(mission, num_robots=6)"),
        ({"num_windows": 10**9}, "number of windows must be a whole number from 1 to 100000"),
    ],
)
def test_what_is_wrong_is_told(keywords, complaint):
    mission = {} if isinstance(keywords.get("task"), swarm_mj.Mission) else SHORT
    with pytest.raises((TypeError, ValueError)) as refused:
        swarm_mj.fly(**(mission | keywords))
    assert complaint in str(refused.value)


def test_memory_is_looked_at_before_the_work(monkeypatch):
    monkeypatch.setattr("swarm_mj.system.needs.free_memory", lambda: 1e6)
    with pytest.raises(ValueError, match="choose fewer num_robots or num_windows, or record=False"):
        swarm_mj.fly(**SHORT)
