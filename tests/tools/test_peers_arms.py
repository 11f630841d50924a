"""The arms of the comparison of speeds, and what stands in for the authors' old libraries."""

import subprocess
import sys

import numpy as np
import peers_arms as tool
import pytest

BASE = """\
import numpy as np
import tensorflow as tf


class MultiAgentEnv:
    def __init__(self, num_agents):
        self.num_agents = np.int(num_agents)
        self.bound = np.Inf
        self.floor = np.NINF
"""
MOVING = """\
from aoi_envs.MultiAgent import MultiAgentEnv
import numpy as np


class MobileEnv(MultiAgentEnv):
    def reset(self):
        self.steps = 0

    def get_relative_network_buffer_as_dict(self):
        return {"nodes": np.zeros(3)}

    def roundrobin_controller(self):
        return "recipients"

    def step(self, action):
        assert action == "recipients"
        self.steps += 1
        return self.get_relative_network_buffer_as_dict()
"""


@pytest.fixture
def clone(tmp_path):
    """A folder of code like the authors', for older libraries."""
    package = tmp_path / "aoi_envs"
    package.mkdir()
    (package / "__init__.py").write_text("", encoding="utf-8")
    (package / "MultiAgent.py").write_text(BASE, encoding="utf-8")
    (package / "Mobile.py").write_text(MOVING, encoding="utf-8")
    yield tmp_path
    for name in [name for name in sys.modules if name.partition(".")[0] == "aoi_envs"]:
        del sys.modules[name]


def test_the_authors_code_runs_on_libraries_of_today(clone):
    before = list(sys.path), sys.modules.get("tensorflow")
    env = tool.authors_environment(clone)
    assert (env.num_agents, env.bound, env.floor) == (40, np.inf, -np.inf)
    assert (list(sys.path), sys.modules.get("tensorflow")) == before
    assert not hasattr(np, "Inf")  # only the authors' modules see it


def test_its_arms_step_with_and_without_features(clone):
    full, bare = tool.authors_arms(clone)
    assert list(full.step()) == ["nodes"]
    assert bare.step() == {}
    assert (full.missions, full.version) == (1, tool.COPIED)


def test_a_clone_says_its_commit(clone):
    def git(*words):
        names = ("-c", "user.name=a", "-c", "user.email=a@b.c")
        command = ["git", *names, "-C", str(clone), *words]
        done = subprocess.run(command, capture_output=True, check=True, encoding="utf-8")
        return done.stdout.strip()

    git("init", "--quiet")
    assert tool.authors_version(clone) == tool.COPIED  # nothing is committed
    git("add", ".")
    git("commit", "--quiet", "--message", "all")
    assert tool.authors_version(clone) == git("rev-parse", "--short=7", "HEAD")


def test_missing_code_is_refused_with_how_to_get_it(tmp_path):
    with pytest.raises(ValueError, match=r"no aoi_envs/Mobile\.py in it; git clone https"):
        tool.authors_environment(tmp_path)


@pytest.mark.parametrize("num_missions", [1, 2])
def test_own_steps_go_on(num_missions):
    for step in (tool.own_step(num_missions), tool.own_environment_step(num_missions)):
        step()
        step()


def test_robots_talk_in_turn_in_the_environments(monkeypatch):
    taken = []

    class Envs:
        def reset(self, seed):
            pass

        def step(self, action):
            taken.append(action)

    monkeypatch.setattr(tool.gymnasium, "make_vec", lambda *_, **__: Envs())
    step = tool.own_environment_step(2)
    for _ in range(41):
        step()
    for window, action in enumerate(taken):
        talks = action != np.arange(40)
        assert talks.sum(axis=1).tolist() == [1, 1]
        assert talks[:, window % 40].all()
