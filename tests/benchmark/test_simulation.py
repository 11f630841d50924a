"""The benchmark measures what it says; how fast is no test's business."""

import pytest

from swarm_mj.benchmark.simulation import (
    IN_STEPS,
    PLAIN_STEP,
    evaluation_rows,
    simulation_rows,
)


def test_a_timing_is_consistent():
    rows = {row.name: row.value for row in simulation_rows(2, seconds=0.05)}
    assert all(value > 0 for value in rows.values())
    window_us = rows["time of one window of one mission"]
    assert rows["windows simulated per second"] == pytest.approx(1e6 / window_us)
    assert rows[IN_STEPS] == pytest.approx(window_us / rows[PLAIN_STEP])
    assert rows["the radio alone"] < window_us


def test_an_evaluations_timing_is_consistent():
    rows = {row.name: row.value for row in evaluation_rows(2, num_jobs=1, seconds=0.05)}
    assert all(value > 0 for value in rows.values())
    baselines_s = rows["random-flooding, round-robin, mst, --jobs 1"]
    window_us = 1e6 * baselines_s / (3 * 2 * 500)  # three baselines, 500 windows each
    assert rows["  one window of one mission, with start-up"] == pytest.approx(window_us)
    assert rows[IN_STEPS] == pytest.approx(window_us / rows[PLAIN_STEP])
