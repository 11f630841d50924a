"""The benchmark measures what it says; how fast is no test's business."""

import numpy as np
import pytest

from swarm_mj.cli.bench_simulation import (
    IN_STEPS,
    PLAIN_STEP,
    evaluation_rows,
    simulation_rows,
    talking,
    world_rows,
)
from swarm_mj.mission import paper
from swarm_mj.policies.centralised import RoundRobin
from swarm_mj.protocol.costs import mean_hops
from swarm_mj.simulation.swarm import Swarm


def test_a_timing_is_consistent():
    rows = {row.name: row.value for row in simulation_rows(2, 1, 0.05)}
    assert all(value > 0 for value in rows.values())
    window_us = rows["time of one window of one mission"]
    assert rows["windows simulated per second"] == pytest.approx(1e6 / window_us)
    assert rows[IN_STEPS] == pytest.approx(window_us / rows[PLAIN_STEP])
    assert rows["the radio alone"] < window_us


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
