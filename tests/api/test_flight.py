"""What a flight takes, by hand, and what it is made of.

tests/faults/test_fit.py compares estimates with peaks.
"""

import math

import pytest

from swarm_mj.api import flight
from swarm_mj.mission import paper
from swarm_mj.policies.policy_arguments import PolicyArguments
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.memory import FLYING
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.terminal import quiet_console


def test_the_commands_engine_flies_what_it_is_told_and_says_so():
    mission = paper("random-walk", num_robots=4, num_windows=6)
    policy = make_policy("mst", mission, 0.25)
    told = flight.Flight(
        mission=mission,
        policy=policy,
        policy_name="mst",
        arguments=PolicyArguments(probability=0.25),
        seed=3,
        observer=2,
    )
    flown = flight.fly_mission(told, console=quiet_console(), way_on=None)
    assert (flown.code, flown.ending) == (0, "")
    config = flown.recorded.config
    assert (config["policy"], config["probability"]) == ("mst", 0.25)
    assert (config["seed"], config["observer"], config["num_robots"]) == (3, 2, 4)
    assert len(flown.run.windows) == len(flown.recorded.footage().window) == 6


def test_a_small_mission_is_flown_ahead_also_for_a_policy_of_one_s_own(monkeypatch):
    flown = []
    monkeypatch.setattr(flight, "summarise", lambda windows: flown.append(len(list(windows))))
    for own in ("nowhere:Mine", "Silent"):
        flight.compile_ahead(
            paper("stationary", num_windows=4), own, PolicyArguments(probability=0.2)
        )
    assert flown == [flight.COMPILING_WINDOWS] * 2


def test_missions_take_at_least_their_buffers():
    mission = paper("stationary", num_robots=200)
    made = sum(array.nbytes for array in vars(Swarm(mission, [1]).buffers).values())
    needs = flight.flight_needs(mission, "tdma", is_recorded=False)
    assert made < needs.memory - FLYING < 2.0 * made


def test_a_long_flight_of_many_takes_what_nobody_has():
    """By hand: 765 kB of memory a window, 110.8 kB of disk."""
    long = paper("random-walk", num_robots=1000, num_windows=100_000)
    needs = flight.flight_needs(long, "tdma", is_recorded=True)
    assert needs.memory == pytest.approx(1e5 * 765e3, rel=0.01)
    assert needs.file == pytest.approx(1e5 * 110.8e3, rel=0.01)
    bare, learned = (flight.flight_needs(long, p, is_recorded=False) for p in ("tdma", "gnn"))
    assert (bare.memory < 0.3e9, bare.file) == (True, 0.0)
    # torch, and the network's input
    assert learned.memory - bare.memory > 0.4e9 + 300 * 1000**2


class Clock:
    """A clock that sleeping moves, and nothing else."""

    now_s = 0.0

    def perf_counter(self):
        return self.now_s

    def sleep(self, how_long_s):
        self.now_s += how_long_s


@pytest.mark.parametrize(("speed", "flown_s"), [(math.inf, 0.0), (1.0, 0.6), (2.0, 0.3)])
def test_a_flight_takes_its_own_time_by_its_speed(monkeypatch, speed, flown_s):
    clock = Clock()
    monkeypatch.setattr(flight, "time", clock)
    mission = paper("random-walk", num_robots=4, num_windows=6)
    policy = make_policy("tdma", mission)
    slow = flight.Flight(mission=mission, policy=policy, policy_name="tdma", seed=3, speed=speed)
    flown = flight.fly_mission(slow, console=quiet_console(), way_on=None)
    assert clock.now_s == pytest.approx(flown_s)
    assert len(flown.run.windows) == 6
