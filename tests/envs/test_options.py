"""What users ask for by other libraries' names, and what they are told."""

import inspect
import re
from pathlib import Path
from typing import get_args, get_type_hints

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from scanners import SCANNERS

from swarm_mj.envs import environment_id, register_environments
from swarm_mj.envs.gymnasium_vector import SwarmVectorEnv
from swarm_mj.envs.options import BatchOptions, make_batch, robot_spaces, team_spaces
from swarm_mj.mission import Task, TaskAndFields
from swarm_mj.policies.gnn.extended_features import ExtendedFeatures, LocalFeatures
from swarm_mj.policies.gnn.graphs import PaperFeatures

SMALL = {"num_robots": 3, "num_windows": 5}


RESET = {"options": {"mask": 1}}
REFUSED = {
    "'swarm_mj/RandomWalk-v0' is a name for gymnasium.*; did you mean 'random-walk'": lambda: (
        make_batch("swarm_mj/RandomWalk-v0")
    ),
    "one of .*; did you mean random-walk": lambda: make_batch("random_walk"),
    "multiple values for keyword argument 'task'": lambda: gymnasium.make(
        "swarm_mj/Flocking-v0", task="stationary"
    ),
    r"give it to reset\(seed=...\)": lambda: gymnasium.make("swarm_mj/Flocking-v0", seed=1),
    'such as "module:Name", not <class .*PaperFeatures': lambda: inspect.unwrap(make_batch)(
        features=PaperFeatures
    ),
    "argument 'mask'; did you mean reset_mask": lambda: SwarmVectorEnv(2, **SMALL).reset(**RESET),
    "number of missions must be 1 or more, not 0": lambda: SwarmVectorEnv(0, **SMALL),
    "with_sensors needs robots with sensors, and robot point has none": lambda: make_batch(
        with_sensors=True, **SMALL
    ),
    "and robot quadrotor has none; choose an MJCF file": lambda: make_batch(
        with_sensors=True, robot="quadrotor", **SMALL
    ),
    "'Same' is not a valid AutoresetMode": lambda: SwarmVectorEnv(
        1, autoreset_mode="Same", **SMALL
    ),
}


@pytest.mark.parametrize("complaint", REFUSED)
def test_what_is_refused(complaint):
    with pytest.raises((ValueError, TypeError), match=complaint):
        REFUSED[complaint]()


def test_type_checkers_are_told_of_the_options_that_interfaces_pass_on():
    parameters = inspect.signature(make_batch).parameters.values()
    own = {each.name: each.annotation for each in parameters if each.kind is each.KEYWORD_ONLY}
    assert get_type_hints(BatchOptions) == own | get_type_hints(TaskAndFields)


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


def test_sensors_are_seen_in_their_units_within_their_cutoffs():
    """The accelerometer's 16 g, the gyro's 2000 degrees a second, the rangefinders' 20 m."""
    team = make_batch("random-walk", 2, with_sensors=True, arena="forest", **SCANNERS, **SMALL)
    plain = make_batch("random-walk", 2, arena="forest", **SCANNERS, **SMALL)
    seen, _ = robot_spaces(team)
    assert isinstance(seen, spaces.Dict)
    assert seen["sensors"].dtype == np.float32
    most = [16.0 * 9.81] * 3 + [np.radians(2000.0)] * 3 + [20.0] * 8
    np.testing.assert_allclose(seen["sensors"].high, most, rtol=1e-3)
    np.testing.assert_allclose(seen["sensors"].low, np.negative(most), rtol=1e-3)
    for batch in (team, plain):
        batch.restart([1, 2])
        batch.step(np.zeros((2, 3), dtype=np.int64))
    shown = team.observation
    np.testing.assert_array_equal(shown["sensors"], team.flown.states.sensors.astype(np.float32))
    assert {name: each[1, 2] for name, each in shown.items()} in seen
    assert {name: each[1] for name, each in shown.items()} in team_spaces(team)[0]
    del shown["sensors"]
    for name, each in plain.observation.items():
        np.testing.assert_array_equal(shown.pop(name), each)
    assert not shown


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


def test_an_arena_that_is_not_there_is_refused_at_once():
    with pytest.raises(ValueError, match="there is no such file"):
        make_batch("stationary", arena="/nope.xml")
