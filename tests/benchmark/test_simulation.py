"""The benchmark measures what it says; how fast is no test's business."""

import pytest

from swarm_mj.benchmark.simulation import evaluation_rows, simulation_rows


def test_a_timing_is_consistent():
    rows = {row.name: row.value for row in simulation_rows(2, seconds=0.05)}
    assert all(value > 0 for value in rows.values())
    assert rows["windows per second"] == pytest.approx(1e6 / rows["one window, µs"])
    in_steps = rows["one window, µs"] / rows["plain mj_step, µs"]
    assert rows["  in plain mj_steps"] == pytest.approx(in_steps)
    assert rows["radio alone, µs"] < rows["one window, µs"]


def test_an_evaluations_timing_is_consistent():
    rows = {row.name: row.value for row in evaluation_rows(2, num_jobs=1, seconds=0.05)}
    assert all(value > 0 for value in rows.values())
    baselines_s = rows["random-flooding, round-robin, mst; 1 jobs, s"]
    window_us = 1e6 * baselines_s / (3 * 2 * 500)  # three baselines, 500 windows each
    in_steps = window_us / rows["plain mj_step, µs"]
    assert rows["  one window, in plain mj_steps"] == pytest.approx(in_steps)
