import re
from pathlib import Path

import numpy as np
from gymnasium import spaces

from swarm_mj.envs.options import make_batch
from swarm_mj.envs.spaces import robot_spaces, team_spaces
from swarm_mj.policies.gnn.extended_features import ExtendedFeatures, LocalFeatures


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
    team.restart([1])
    now = {name: each[0] for name, each in team.observation.items()}
    assert now in all_seen
    assert {name: each[2] for name, each in now.items()} in seen


def test_parents_are_seen_on_request_only():
    assert set(robot_spaces(make_batch("stationary"))[0]) == {"action_mask", "observation"}


OWN = """
import numpy as np
from swarm_mj.policies.gnn.graphs import PaperFeatures

class Mine(PaperFeatures):
    names = ("T", "huge")

    def graphs(self, views):
        from dataclasses import replace
        seen = super().graphs(views)
        return replace(seen, node=np.full((*seen.parent.shape, 2), 1e9, dtype=np.float32))
"""


def test_features_of_ones_own_have_no_bounds(here, monkeypatch):
    monkeypatch.syspath_prepend(here)
    (here / "mine_features.py").write_text(OWN)
    team = make_batch("stationary", num_robots=3, features="mine_features:Mine")
    seen, _ = robot_spaces(team)
    team.restart([1])
    assert team.observation["observation"].shape == (1, 3, 3, 2)
    assert {name: each[0, 0] for name, each in team.observation.items()} in seen


def test_the_documentation_names_the_columns_in_order():
    page = (Path(__file__).parents[2] / "docs" / "environments.md").read_text()
    rows = re.findall(r"^\| (\d+) \| ([^|]+) \|", page, re.MULTILINE)
    assert rows == [(str(n), name) for n, name in enumerate(ExtendedFeatures.names)]
    without = [
        n for n, name in enumerate(ExtendedFeatures.names) if name not in LocalFeatures.names
    ]
    assert f"`local` leaves out columns {without[0]} to {without[-1]}" in page
    assert without == list(range(without[0], without[-1] + 1))
