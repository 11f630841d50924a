"""Estimates of training runs against the arrays that are made."""

from dataclasses import replace

import pytest

from swarm_mj.learning.estimates import rollout_bytes, training_needs
from swarm_mj.learning.ppo import make_model
from swarm_mj.learning.run_folder import Limits
from swarm_mj.learning.settings import usual_settings
from swarm_mj.mission import paper
from swarm_mj.policies.gnn.packet_memory import empty_memory
from swarm_mj.replay.recorder import replay_file


@pytest.mark.parametrize("credit", ["robot", "team"])
def test_a_rollout_is_of_the_arrays_that_are_made(credit):
    mission = paper("stationary", num_robots=6, range_ratio=0.5)
    training = replace(usual_settings(credit, mission, (6,)), missions=4)
    buffer = make_model(training)[0].rollout_buffer
    made = sum(rows.nbytes for rows in buffer.observations.values())
    assert made < rollout_bytes(training) < 2.0 * made


def test_a_rollout_counts_what_robots_remember_of_packets():
    """In teams of 40 more than the one graph a robot by which the estimate exceeds the rollout."""
    training = replace(usual_settings("robot", paper("stationary"), (40,)), missions=4)
    buffer = make_model(training)[0].rollout_buffer
    made = sum(rows.nbytes for rows in buffer.observations.values())
    made += sum(array.nbytes for array in empty_memory(4, 40))
    assert made < rollout_bytes(training)


def test_replays_of_a_training_are_counted():
    training = usual_settings("robot", paper("random-walk"), (40,))
    none = training_needs(training, Limits(decisions=1000))
    ten = training_needs(training, Limits(decisions=1000, replay_every=100))
    each = replay_file(training.mission)
    assert ten.file - none.file == pytest.approx(11 * each)
    assert ten.memory > none.memory
    assert ten.addresses > none.addresses
