"""What a flight takes, by hand (faults/test_fit.py measures peaks), and what is compiled ahead."""

import pytest

from swarm_mj.api.flight import COMPILING_WINDOWS, compile_ahead, flight_needs
from swarm_mj.mission import paper
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.needs import LIBRARIES

MISSION = paper("stationary", num_robots=3, num_windows=4, range_ratio=5.0)
LONG = paper("random-walk", num_robots=1000, num_windows=100_000)


def test_a_small_mission_is_flown_ahead_also_for_a_policy_of_one_s_own():
    windows = []
    compile_ahead(MISSION, "nowhere:Mine", lambda: windows.append(1), probability=0.2)
    assert len(windows) == COMPILING_WINDOWS


def test_missions_take_at_least_their_buffers():
    mission = paper("stationary", num_robots=200)
    made = sum(array.nbytes for array in vars(Swarm(mission, [1]).buffers).values())
    needs = flight_needs(mission, "tdma", is_recorded=False)
    assert made < needs.memory - LIBRARIES < 2.0 * made


def test_a_long_flight_of_many_takes_what_nobody_has():
    """By hand: 1016 kB of memory a window, 150.5 kB of disk."""
    needs = flight_needs(LONG, "tdma", is_recorded=True)
    assert needs.memory == pytest.approx(1e5 * 1.015e6, rel=0.01)
    assert needs.file == pytest.approx(1e5 * 150.5e3, rel=0.01)
    bare, learned = (flight_needs(LONG, name, is_recorded=False) for name in ("tdma", "gnn"))
    assert (bare.memory < 0.3e9, bare.file) == (True, 0.0)
    # torch, and the packets that a learned policy's robots remember
    assert learned.memory - bare.memory > 4 * 1000**3
    assert learned.addresses > bare.addresses
