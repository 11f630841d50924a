import pytest
from residual_networks import some_weights

from swarm_mj.mission import paper, reference
from swarm_mj.policies.residual.making import residual_policy
from swarm_mj.policies.residual.policy import ResidualPolicy


@pytest.mark.parametrize("preset", [paper, reference])
def test_a_team_at_rest_has_one(preset):
    policy = residual_policy(some_weights(), preset("stationary", num_robots=5))
    assert type(policy) is ResidualPolicy
    assert policy.parameters["is_deterministic"] is False
    assert policy.payload == "none"
    assert policy.uses.endswith("what the robot remembers of its neighbours and of its own packets")


@pytest.mark.parametrize("task", ["random-walk", "flocking"])
def test_a_team_that_moves_has_none(task):
    said = f"are for teams at rest, and those of {task} move; add --task stationary, or fly another"
    with pytest.raises(ValueError, match=said):
        residual_policy(some_weights(), paper(task, num_robots=5))
