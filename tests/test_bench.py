"""The benchmark measures what it says; how fast is no test's business."""

import pytest

from swarm_mj.bench import bench


def test_a_timing_is_consistent():
    timing = bench(2, seconds=0.05)
    assert timing.num_missions == 2
    assert timing.windows_per_s > 0
    assert all(part > 0 for part in timing.parts_us.values())
    whole_us = 1e6 / timing.windows_per_s
    assert timing.in_mj_steps == pytest.approx(whole_us / timing.mj_step_us)
