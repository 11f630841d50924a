"""The benchmark measures what it says; how fast is no test's business."""

import time

import numpy as np
import pytest

from swarm_mj.cli.bench_simulation import (
    IN_STEPS,
    PLAIN_STEP,
    Row,
    clock_of,
    evaluation_rows,
    growth,
    in_turn_us,
    microseconds,
    simulation_rows,
    talking,
    team_rows,
    world_rows,
)
from swarm_mj.mission import paper
from swarm_mj.policies.centralised import RoundRobin
from swarm_mj.protocol.costs import mean_hops
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system import needs


def test_a_timing_is_consistent():
    rows = {row.name: row.value for row in simulation_rows(2, 1, 0.05)}
    assert all(value > 0 for value in rows.values())
    window_us = rows["time of one window of one mission"]
    assert rows["windows simulated per second"] == pytest.approx(1e6 / window_us)
    assert rows[IN_STEPS] == pytest.approx(window_us / rows[PLAIN_STEP])
    assert rows["the radio alone"] < window_us


def test_what_is_compared_is_timed_in_turn_after_a_call_that_is_not_timed():
    called = []
    times_us = in_turn_us((lambda: called.append("a"), lambda: called.append("b")), 1e-9)
    assert len(times_us) == 2
    assert called == ["a", "a", "b", "b", *["a", "b"] * 7]  # how long each takes comes first


def test_pauses_for_other_programs_do_not_count_unless_threads_share_the_work():
    """A sleep of 20 ms is a pause: it takes this thread no time on a processor."""

    def rest():
        time.sleep(0.02)

    assert microseconds(rest, 1e-9) < 5_000.0
    assert microseconds(rest, 1e-9, clock_of(2)) > 20_000.0
    assert clock_of(1) is time.thread_time


@pytest.mark.slow
def test_worlds_are_timed_against_free_space_in_the_same_physics():
    rows = {row.name: row.value for row in world_rows(2, 0.05)}
    assert all(value > 0 for value in rows.values())
    fading = rows["Rayleigh fading"] / rows["free space"]
    assert rows["  times free space"] == pytest.approx(fading)
    obstacles = rows["arena blocks, contact physics"] / rows["free space, contact physics"]
    assert rows["  times none"] == pytest.approx(obstacles)


@pytest.mark.slow
def test_an_evaluations_timing_is_consistent():
    rows = {row.name: row.value for row in evaluation_rows(2, 1, 0.05)}
    assert all(value > 0 for value in rows.values())
    baselines_s = rows["random-flooding, round-robin, mst, --jobs 1"]
    window_us = 1e6 * baselines_s / (3 * 2 * 500)  # three baselines, 500 windows each
    assert rows["  one window of one mission, with start-up"] == pytest.approx(window_us)
    assert rows[IN_STEPS] == pytest.approx(window_us / rows[PLAIN_STEP])


def test_what_is_timed_leaves_no_entries_from_the_future():
    """Parents of known robots lead back to the owner, however often each part was repeated."""
    swarm, policy = Swarm(paper("random-walk", num_robots=12), [0, 1]), RoundRobin()
    swarm.start(policy)
    talk = talking(swarm, swarm.decide())
    for _ in range(60):
        swarm.step(policy)
    for _ in range(20):
        talk()
        assert np.all(swarm.now == np.diagonal(swarm.buffers.timestamp, axis1=1, axis2=2).T)
        mean_hops(swarm.buffers)  # raises where parents form a circle


def test_a_team_is_measured_in_a_process_of_its_own():
    """Its tables of 600 robots take 19 MB, whatever this process has held."""
    assert needs.peak_memory() > 1e6
    rows = {row.name: row.value for row in team_rows(600, 0.1)}
    assert min(rows.values()) > 0.0
    assert 52e-6 * 600**2 < rows["team, MB"] < 3.0 * 52e-6 * 600**2
    assert rows["  estimated"] == pytest.approx(57e-6 * 600**2 + 8.5e-3 * 600)
    assert rows["process, MB"] > 50.0 + rows["team, MB"]


def test_a_team_that_does_not_fit_is_refused(monkeypatch):
    monkeypatch.setattr(needs, "free_memory", lambda: 1e9)
    with pytest.raises(ValueError, match=r"5.84 GB of memory, and 1 GB are free; choose fewer"):
        next(team_rows(10_000, 0.1))


def test_growth_is_that_of_the_three_largest_teams():
    teams = {str(n): [Row("a", 1.0), Row("b", 0.5 * n**1.5)] for n in (8, 16, 32)}
    teams = {"2": [Row("a", 9.0), Row("b", 9.0)], **teams}
    assert growth(teams, "b") == pytest.approx((1.5, 0.5))
    assert growth(teams, "a") == pytest.approx((0.0, 1.0))
