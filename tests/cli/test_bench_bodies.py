"""The benchmark of bodies measures what it says; how fast they are is no test's business."""

import numpy as np
import pytest

from swarm_mj.cli import bench_bodies
from swarm_mj.cli.bench_bodies import (
    IN_STEPS,
    PLAIN_STEP,
    TIMES_POINTS,
    body_rows,
    plain_step,
    steering,
)
from swarm_mj.mission import paper
from swarm_mj.policies.centralised import RoundRobin
from swarm_mj.simulation.swarm import Swarm


def test_a_timing_is_consistent():
    rows = {row.name: row.value for row in body_rows(2, 0.05)}
    assert all(value > 0 for value in rows.values())
    window_us = rows["time of one window of one mission"]
    # Steps of 5 ms in a window of 100 ms are 20.
    assert rows[f"{IN_STEPS} 20"] == pytest.approx(window_us / 20 / rows[PLAIN_STEP])
    assert rows[TIMES_POINTS] == pytest.approx(window_us / rows["such a window of points"])


def test_plain_steps_are_all_of_the_first_mission_s_quadrotors_as_they_fly(monkeypatch):
    swarm = Swarm(paper("random-walk", robot="quadrotor"), [5, 6])
    step = plain_step(swarm)
    stepped = []

    def note(model, data):
        height_m = data.qpos.reshape(40, 7)[:, 2]
        stepped.append((model.opt.timestep, height_m.copy(), data.qvel.copy()))
        data.qpos[:] = 0.0

    monkeypatch.setattr(bench_bodies, "mj_step", note)
    swarm.start(RoundRobin())
    swarm.step()  # changes nothing of what is timed
    for _ in range(3):
        step()
    start_mps = Swarm(swarm.mission, [5]).states.velocity_mps[0]
    assert len(stepped) == 3
    for step_s, height_m, qvel in stepped:
        assert step_s == 0.005
        assert np.all(height_m == 20.0)
        np.testing.assert_array_equal(qvel.reshape(40, 6)[:, :3], start_mps)


def test_what_steers_writes_controls_of_all_missions():
    written = []

    def pilot(sensed, wanted, control):
        written.append((sensed.attitude[..., 0].sum(), wanted.velocity_mps.shape, control.shape))

    steering(pilot, 3)()
    assert written == [(120.0, (3, 40, 3), (3, 40, 4))]
