"""Arguments passed on whole make the policy that they make one by one."""

import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.policy_arguments import PolicyArguments
from swarm_mj.policies.registry import make_policy, make_policy_with

MISSION = paper("stationary", num_robots=4)


def test_the_usual_arguments_change_nothing():
    made = make_policy_with(PolicyArguments(), "aloha", MISSION)
    assert made.parameters == make_policy("aloha", MISSION).parameters


def test_each_argument_reaches_the_policy():
    often = make_policy_with(PolicyArguments(probability=0.3), "aloha", MISSION)
    assert often.parameters == {"probability": 0.3}
    most_probable = make_policy_with(PolicyArguments(is_deterministic=True), "gnn", MISSION)
    assert most_probable.parameters["is_deterministic"] is True
    with pytest.raises(ValueError, match="applies to learned policies only, not to tdma"):
        make_policy_with(PolicyArguments(is_deterministic=True), "tdma", MISSION)
