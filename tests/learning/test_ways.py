"""The ways to train, by the policy and its credit."""

from dataclasses import replace

import pytest

from swarm_mj.learning.settings import usual_index_settings, usual_settings
from swarm_mj.learning.ways import INDEX, ROBOT, TEAM
from swarm_mj.mission import paper

FLOWN = (paper("stationary"), (40,))


def test_a_network_is_trained_by_its_credit_and_an_index_by_none():
    assert usual_settings("robot", *FLOWN).way is ROBOT
    assert usual_settings("team", *FLOWN).way is TEAM
    index = usual_index_settings(*FLOWN)
    assert index.way is INDEX
    assert replace(index, credit_assignment="team", unknown_age=0.0).way is INDEX


@pytest.mark.parametrize("way", [ROBOT, TEAM, INDEX])
def test_only_networks_stop_after_rollouts(way):
    assert way.is_network == (way.step == "rollout")


def test_the_paper_s_way_makes_its_two_million_observations():
    assert TEAM.budget == 2e6
