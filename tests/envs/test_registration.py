from typing import get_args

import gymnasium
import pytest

from swarm_mj.envs.registration import environment_id, register_environments
from swarm_mj.mission import Task


@pytest.mark.parametrize("task", get_args(Task))
def test_every_task_has_an_environment(task):
    register_environments()
    env = gymnasium.make(environment_id(task), num_robots=3)
    assert env.unwrapped.batch.mission.task == task
    assert env.unwrapped.batch.mission.num_robots == 3
    assert gymnasium.spec(environment_id(task)).vector_entry_point is not None


def test_names_are_written_as_gymnasium_writes_them():
    assert environment_id("stationary") == "swarm_mj/Stationary-v0"
    assert environment_id("random-walk") == "swarm_mj/RandomWalk-v0"


def test_registering_twice_warns_of_nothing(recwarn):
    register_environments()
    register_environments()
    assert not recwarn.list
