"""A study's memory grows with its jobs and its teams, its files with its missions."""

import pytest

from swarm_mj.evaluation.study import Study
from swarm_mj.evaluation.study_needs import study_needs
from swarm_mj.mission import paper
from swarm_mj.simulation.memory import LIBRARIES


def test_a_study_has_a_batch_in_each_process_while_batches_last():
    """A process may get the largest team, whatever else is flown."""
    large = paper("stationary", num_robots=100)
    small = paper("stationary", num_robots=10)
    both = Study(policies=("tdma", "gossip"), regimes=(large, small), episodes=50)
    one, two, many = (study_needs(both, jobs).memory for jobs in (1, 2, 256))
    each = two - one
    assert many == pytest.approx(one + 7 * each)  # 2 regimes, 2 policies, 2 batches of 25
    alone = Study(policies=("tdma",), regimes=(large,), episodes=50)
    assert each == pytest.approx(study_needs(alone, 2).memory - study_needs(alone, 1).memory)
    assert each > LIBRARIES


def test_a_studys_files_grow_with_its_missions():
    regimes = (paper("stationary", num_windows=100_000),)
    studies = (Study(policies=("tdma",), regimes=regimes, episodes=n) for n in (25, 25_000))
    few, many = (study_needs(study, 1).file for study in studies)
    assert many == pytest.approx(1000 * few)
    assert many > 5e8
