"""What users ask for by other libraries' names, and what they are told."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import swarm_mj  # noqa: F401 - which registers environments
from swarm_mj.envs.gymnasium import SwarmEnv
from swarm_mj.envs.gymnasium_vector import SwarmVectorEnv
from swarm_mj.envs.options import check_features_named, make_batch
from swarm_mj.mission import paper
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
        return replace(seen, node=seen.node[:, :, :2])
"""


def test_own_features_name_all_their_numbers(here, monkeypatch):
    monkeypatch.syspath_prepend(here)
    (here / "two_of_three.py").write_text(OWN)
    team = make_batch(features="two_of_three:Three", **SMALL)
    with pytest.raises(ValueError, match="two_of_three:Three names 3 features, but its node has 2"):
        team.restart([1])


def test_features_are_no_class():
    with pytest.raises(
        TypeError, match=r'features="swarm_mj\.policies\.gnn\.graphs:PaperFeatures"'
    ):
        check_features_named(PaperFeatures)
    check_features_named("swarm_mj.policies.gnn.graphs:PaperFeatures")


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
