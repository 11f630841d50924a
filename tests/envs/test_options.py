"""What users ask for by other libraries' names, and what they are told."""

import re
from pathlib import Path
from typing import get_args

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import AutoresetMode

from swarm_mj.envs import environment_id, register_environments
from swarm_mj.envs.gymnasium import SwarmEnv
from swarm_mj.envs.gymnasium_vector import SwarmVectorEnv
from swarm_mj.envs.options import check_features_named, make_batch, robot_spaces, team_spaces
from swarm_mj.mission import Task, paper
from swarm_mj.policies.gnn.extended_features import ExtendedFeatures, LocalFeatures
from swarm_mj.policies.gnn.graphs import PaperFeatures

SMALL = {"num_robots": 3, "num_windows": 5}


@pytest.mark.parametrize("name", ["RandomWalk", "swarm_mj/RandomWalk-v0", "random_walk"])
def test_tasks_by_other_names(name):
    with pytest.raises(ValueError, match=r"must be one of .*; did you mean random-walk\?"):
        make_batch(name)


def test_an_environments_name_settles_its_task():
    with pytest.raises(TypeError, match="here 'flocking'; use swarm_mj/Coverage-v0 or 'coverage'"):
        gymnasium.make("swarm_mj/Flocking-v0", task="coverage")
    assert make_batch(paper("flocking"), task="coverage").mission.task == "coverage"


def test_seeds_are_given_to_reset():
    with pytest.raises(TypeError, match=r"give it to reset\(seed=...\)"):
        gymnasium.make("swarm_mj/Flocking-v0", seed=1)


OWN = """
from dataclasses import replace
from swarm_mj.policies.gnn.graphs import PaperFeatures

class Three(PaperFeatures):
    names = ("one", "two", "three")

    def graphs(self, views):
        seen = super().graphs(views)
        return replace(seen, node=1e9 + seen.node[:, :, :2])

class Two(Three):
    names = ("one", "two")
"""


def test_own_features_name_all_their_numbers_which_have_no_bounds(here, monkeypatch):
    monkeypatch.syspath_prepend(here)
    (here / "two_of_three.py").write_text(OWN)
    team = make_batch(features="two_of_three:Three", **SMALL)
    with pytest.raises(ValueError, match="two_of_three:Three names 3 features, but its node has 2"):
        team.restart([1])
    team = make_batch(features="two_of_three:Two", **SMALL)
    seen, _ = robot_spaces(team)
    team.restart([1])
    assert {name: each[0, 0] for name, each in team.observation.items()} in seen


def test_features_are_no_class():
    named = r'features="swarm_mj\.policies\.gnn\.graphs:PaperFeatures"'
    with pytest.raises(TypeError, match=named):
        check_features_named(PaperFeatures)


def test_options_of_reset():
    single, vector = SwarmEnv(**SMALL), SwarmVectorEnv(2, **SMALL)
    with pytest.raises(ValueError, match="no option 'mask'; it has none"):
        single.reset(options={"mask": 1})
    with pytest.raises(ValueError, match="no option 'mask'; it has reset_mask"):
        vector.reset(options={"mask": 1})
    single.reset(options={})
    vector.reset(options={"reset_mask": np.ones(2, dtype=bool)})


def test_what_a_vector_is_not():
    with pytest.raises(ValueError, match="num_envs must be 1 or more, not 0"):
        SwarmVectorEnv(0, **SMALL)
    with pytest.raises(ValueError, match="NextStep, SameStep, Disabled, not 'Same'; did you mean"):
        SwarmVectorEnv(1, autoreset_mode="Same", **SMALL)
    for mode in ("SameStep", AutoresetMode.SAME_STEP):
        env = SwarmVectorEnv(1, autoreset_mode=mode, **SMALL)
        assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP


def test_a_robot_sees_a_row_of_what_the_team_sees():
    team = make_batch("stationary", num_robots=4, features="paper", with_parents=True)
    seen, action = robot_spaces(team)
    assert action == spaces.Discrete(4)
    assert {name: (each.shape, each.dtype) for name, each in seen.items()} == {
        "action_mask": ((4,), np.int8),
        "observation": ((4, 8), np.float32),
        "parent": ((4,), np.int32),
    }
    all_seen, joint = team_spaces(team)
    assert joint == spaces.MultiDiscrete([4, 4, 4, 4])
    assert {name: each.shape for name, each in all_seen.items()} == {
        "action_mask": (4, 4),
        "observation": (4, 4, 8),
        "parent": (4, 4),
    }
    assert set(robot_spaces(make_batch("stationary"))[0]) == {"action_mask", "observation"}
    team.restart([1])
    now = {name: each[0] for name, each in team.observation.items()}
    assert now in all_seen
    assert {name: each[2] for name, each in now.items()} in seen


def test_the_documentation_names_the_columns_in_order():
    page = (Path(__file__).parents[2] / "docs" / "environments.md").read_text()
    rows = re.findall(r"^\| (\d+) \| ([^|]+) \|", page, re.MULTILINE)
    assert rows == [(str(n), name) for n, name in enumerate(ExtendedFeatures.names)]
    without = [
        n for n, name in enumerate(ExtendedFeatures.names) if name not in LocalFeatures.names
    ]
    assert f"`local` leaves out columns {without[0]} to {without[-1]}" in page
    assert without == list(range(without[0], without[-1] + 1))


@pytest.mark.parametrize("task", get_args(Task))
def test_every_task_has_an_environment(task, recwarn):
    assert environment_id("random-walk") == "swarm_mj/RandomWalk-v0"
    for _ in range(2):  # the second time warns of nothing
        register_environments()
    assert not recwarn.list
    env = gymnasium.make(environment_id(task), num_robots=3)
    assert env.unwrapped.batch.mission.task == task
    assert env.unwrapped.batch.mission.num_robots == 3
    assert gymnasium.spec(environment_id(task)).vector_entry_point is not None
