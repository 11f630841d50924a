"""The benchmark measures what it says; how fast is no test's business."""

import pytest

from swarm_mj.benchmark.simulation import bench, bench_evaluation


def test_a_timing_is_consistent():
    timing = bench(2, seconds=0.05)
    assert timing.num_missions == 2
    assert timing.windows_per_s > 0
    assert all(part > 0 for part in timing.parts_us.values())
    whole_us = 1e6 / timing.windows_per_s
    assert timing.in_mj_steps == pytest.approx(whole_us / timing.mj_step_us)


def test_an_evaluations_timing_is_consistent():
    timing = bench_evaluation(2, num_jobs=1, seconds=0.05)
    assert (timing.episodes, timing.num_jobs) == (2, 1)
    assert timing.oracle_s > 0
    window_us = 1e6 * timing.baselines_s / (3 * 2 * 500)  # three baselines, 500 windows each
    assert timing.window_in_mj_steps == pytest.approx(window_us / timing.mj_step_us)
