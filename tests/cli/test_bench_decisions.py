"""The decisions of policies are timed as they fly; how fast they are is no test's business."""

import numpy as np

from swarm_mj.cli import bench_decisions
from swarm_mj.cli.bench_decisions import TimedSwarm, decision_rows
from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.swarm import Swarm


def test_every_policy_has_a_row_of_the_time_that_a_window_s_decisions_take(monkeypatch):
    """Each decision takes a second here: of a window's one, or two where robots broadcast."""
    ticks = iter(range(10_000))
    monkeypatch.setattr(bench_decisions.time, "thread_time", lambda: float(next(ticks)))
    monkeypatch.setattr(bench_decisions, "NUM_WINDOWS", 12)
    names = ("round-robin", "tdma", "planner")
    rows = list(decision_rows(paper("random-walk", num_robots=6), names, 0.0))
    assert [row.name for row in rows] == list(names)
    assert [row.value for row in rows] == [1e6, 2e6, 2e6]


def test_the_clock_runs_in_every_slot_and_changes_no_decision(monkeypatch):
    """Each decision takes a second here; a window has two where robots broadcast, or else one."""
    ticks = iter(range(1000))
    monkeypatch.setattr(bench_decisions.time, "thread_time", lambda: float(next(ticks)))
    mission = paper("stationary", num_robots=6)
    for name, num_decisions in (("round-robin", 5), ("tdma", 10)):
        timed, plain = TimedSwarm(mission, [1]), Swarm(mission, [1])
        for swarm in (timed, plain):
            swarm.start(make_policy(name, mission))
            for _ in range(5):
                swarm.step()
        assert timed.deciding_s == num_decisions
        assert np.array_equal(timed.buffers.timestamp, plain.buffers.timestamp)
