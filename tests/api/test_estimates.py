"""Estimates by hand; faults/test_fit.py measures peaks."""

import pytest

from swarm_mj.api.estimates import figures_needs, flight_needs, study_needs
from swarm_mj.evaluation.study import Study
from swarm_mj.mission import paper
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.needs import LIBRARIES

LONG = paper("random-walk", num_robots=1000, num_windows=100_000)


def test_missions_take_at_least_their_buffers():
    mission = paper("stationary", num_robots=200)
    buffers = vars(Swarm(mission, [1]).buffers).values()
    made = sum(array.nbytes for array in buffers)
    needs = flight_needs(mission, "tdma", is_recorded=False)
    assert made < needs.memory - LIBRARIES < 2.0 * made


def test_a_long_flight_of_many_takes_what_nobody_has():
    """By hand: 1016 kB of memory a window, 150.5 kB of disk."""
    needs = flight_needs(LONG, "tdma", is_recorded=True)
    assert needs.memory == pytest.approx(1e5 * 1.015e6, rel=0.01)
    assert needs.file == pytest.approx(1e5 * 150.5e3, rel=0.01)
    bare = flight_needs(LONG, "tdma", is_recorded=False)
    assert (bare.memory < 0.3e9, bare.file) == (True, 0.0)


def test_learned_policies_need_torch_and_what_their_robots_remember():
    own, rule = (flight_needs(LONG, name, is_recorded=False) for name in ("gnn", "tdma"))
    assert own.memory - rule.memory > 4 * 1000**3
    assert own.addresses > rule.addresses


def test_a_study_has_a_batch_in_each_process_while_batches_last():
    regimes = (paper("stationary", num_robots=100), paper("stationary", num_robots=10))
    study = Study(policies=("tdma", "gossip"), regimes=regimes, episodes=50)
    one, two, many = (study_needs(study, jobs).memory for jobs in (1, 2, 256))
    each = two - one
    assert each == pytest.approx(LIBRARIES + 100 * 25 * 100**2)
    assert many == pytest.approx(one + 7 * each)  # 2 regimes, 2 policies, 2 batches of 25


def test_a_studys_files_grow_with_its_missions():
    regimes = (paper("stationary", num_windows=100_000),)
    few, many = (
        study_needs(Study(policies=("tdma",), regimes=regimes, episodes=count), 1).file
        for count in (25, 25_000)
    )
    assert many == pytest.approx(1000 * few)
    assert many > 5e8


def test_figures_take_more_for_larger_results(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"x" * 1000)
    one, two = (figures_needs([tmp_path / "a.csv"] * count, 2 * count) for count in (1, 2))
    assert two.memory - one.memory == 10_000
    assert two.file - one.file == 2e6
    assert figures_needs([tmp_path / "missing.csv", tmp_path], 1).memory < one.memory
