"""Names of policies, and directories in their place."""

import os

import pytest
from tiny_policies import save_tiny

from swarm_mj.io.assets import asset
from swarm_mj.mission import paper
from swarm_mj.policies.gnn import LearnedPolicy
from swarm_mj.policies.registry import (
    POLICIES,
    is_directory,
    is_learned,
    make_policy,
    normalised,
    with_payload,
)

MISSION = paper("stationary", num_robots=5)
pytestmark = pytest.mark.usefixtures("here")


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A working directory with policies, two of them under names of others."""
    monkeypatch.chdir(tmp_path)
    for name in ("runs/x/policy", "mine", "mst", "all"):
        save_tiny(tmp_path / name, "paper")


@pytest.mark.parametrize(
    "name",
    ["runs/x/policy", "./runs/x/policy/", "mine", "mine/", "./mst", "mst/", "runs/../mine", "all"],
)
def test_a_directory_is_a_learned_policy(tmp_path, name):
    for typed in (name, normalised(name), str(tmp_path / name)):
        assert is_directory(typed)
        assert is_learned(typed)
        assert isinstance(make_policy(typed, MISSION), LearnedPolicy)


def test_a_name_is_a_name_whatever_lies_about():
    assert not any(map(is_directory, POLICIES))
    assert make_policy("mst", MISSION).parameters["probability"] > 0.0
    assert [normalised(name) for name in POLICIES] == list(POLICIES)


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        ("runs/x/policy", "runs/x/policy"),
        ("./runs//x/policy/", "runs/x/policy"),
        ("mine/", "mine"),
        ("./mine", "mine"),
        ("./mst", "./mst"),
        ("mst/", "./mst"),
        ("gone/", "./gone"),
        ("rumour", "rumour"),
        ("", ""),
    ],
)
def test_names_are_as_typed_but_for_what_leads_nowhere_else(typed, expected):
    assert normalised(typed) == expected.replace("/", os.sep)


@pytest.mark.parametrize("name", ["rumour", ""])
def test_what_is_neither_a_name_nor_a_directory(name):
    with pytest.raises(ValueError, match=f"or a directory with a learned policy, not '{name}'"):
        make_policy(name, MISSION)


def test_a_path_that_leads_nowhere():
    with pytest.raises(ValueError, match="policy runs/y does not exist; name a directory"):
        make_policy("runs/y", MISSION)


def test_a_learned_policy_has_no_probability():
    with pytest.raises(ValueError, match="mine takes no transmission probability; leave out"):
        make_policy("mine", MISSION, 0.1)


def test_only_a_learned_policy_is_made_deterministic():
    for name in ("mine", "gnn"):
        policy = make_policy(name, MISSION, is_deterministic=True)
        assert policy.parameters["is_deterministic"] is True
    for name in POLICIES:
        if name != "gnn":
            with pytest.raises(ValueError, match=f"{name} draws from no network"):
                make_policy(name, MISSION, is_deterministic=True)


def test_the_shipped_policy_is_the_network_in_assets(tmp_path):
    save_tiny(tmp_path / "gnn", "paper")  # a folder of the same name is another policy
    shipped = make_policy("gnn", MISSION)
    assert is_learned("gnn")
    assert shipped.parameters == make_policy(str(asset("policies/gnn")), MISSION).parameters
    assert shipped.parameters != make_policy("./gnn", MISSION).parameters
    assert shipped.payload == "none"
    with pytest.raises(ValueError, match="gnn takes no transmission probability; leave out"):
        make_policy("gnn", MISSION, 0.1)


def test_ii_b_the_planner_can_go_without_payload():
    """A name typed with the option is the name of a policy of its own; others carry nothing."""
    assert with_payload(["tdma", "planner"], "none") == ["tdma", "planner --payload none"]
    assert with_payload(["planner --payload none"], "none") == ["planner --payload none"]
    assert with_payload(["tdma"], "snapshots") == ["tdma"]
    with pytest.raises(ValueError, match="packets of tdma, mst carry none; leave out --payload"):
        with_payload(["tdma", "mst"], "none")
    with pytest.raises(ValueError, match="payload must be one of snapshots, none, not 'all'"):
        with_payload(["planner"], "all")
