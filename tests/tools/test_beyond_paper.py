"""What policies use beyond the paper: the page, the command line and the policies agree."""

import json
import re
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from swarm_mj.cli import main
from swarm_mj.mission import paper
from swarm_mj.policies.about import Information
from swarm_mj.policies.planner.resting import WITH_LINKS
from swarm_mj.policies.registry import LISTED, POLICIES, make_policy
from swarm_mj.simulation.swarm import Swarm

PAGE = Path(__file__).parents[2] / "docs" / "results.md"
POSITIONS = {"noisy": "positions as observed", "true": "true positions"}
# The rows of the table, by what is typed: a policy, and a task if it matters.
TYPED = {f"`{name}`": (name, "flocking") for name in POLICIES if not name.startswith("planner")} | {
    "`planner`, moving": ("planner", "random-walk"),
    "`planner`, at rest": ("planner", "stationary"),
    "`planner --payload none`, at rest": ("planner --payload none", "stationary"),
}


@pytest.fixture(scope="module")
def table():
    return import_module("beyond_paper").table()


def kinds_by_row(table):
    """The kinds that are marked in each row."""
    head, _, *rows = (
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in table.splitlines()
        if line.startswith("|")
    )
    for row, *marks in rows:
        marked = {kind: mark for kind, mark in zip(head[1:], marks, strict=True) if mark}
        position = {POSITIONS[marked.pop("positions")]} if "positions" in marked else set()
        assert set(marked.values()) <= {"yes"}
        yield row, position | set(marked)


def test_the_page_has_the_table(table):
    (shown,) = re.findall(
        r"^<!-- table: beyond-paper -->\n\n(.*?)\n\n<!-- end -->$", PAGE.read_text(), re.M | re.S
    )
    assert shown == table


def test_the_table_says_what_the_command_line_says(table, capsys):
    rows = dict(kinds_by_row(table))
    assert set(rows) == set(TYPED)
    for row, (name, task) in TYPED.items():
        assert main(["policies", name, "--task", task, "--json"]) == 0
        listed = json.loads(capsys.readouterr().out)["beyond_paper"]
        assert rows[row] == set(listed), row
        assert len(listed) == len(set(listed)), row


def test_every_kind_is_explained_and_used():
    used = {kind for about in LISTED.values() for kind in about.beyond}
    assert used == set(Information)
    assert all(kind.sentence.endswith(".") for kind in Information)
    assert len({kind.label for kind in Information}) == len(Information)


def test_without_a_payload_moving_teams_use_what_spatial_tdma_does(capsys):
    assert main(["policies", "planner --payload none", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["beyond_paper"]
    assert listed == [kind.label for kind in LISTED["spatial-tdma"].beyond]


def timestamps(name, noise_m):
    """T after a mission of robots at rest, whose errors of positions change nothing but M."""
    mission = paper("stationary", num_robots=16, position_noise_m=noise_m)
    swarm = Swarm(mission, seeds=[3])
    policy = make_policy(name, mission)
    for _ in range(60):
        swarm.step(policy)
    return swarm.buffers.timestamp


@pytest.mark.parametrize("name", POLICIES)
def test_errors_of_positions_reach_the_policies_that_use_them(name):
    """At 200 m (the range is 250 m) they change who transmits, or do not reach the policy."""
    about = WITH_LINKS if name == "planner" else LISTED[name]
    changes = not np.array_equal(timestamps(name, 0.0), timestamps(name, 200.0))
    assert changes == (Information.OBSERVED_POSITIONS in about.beyond)
