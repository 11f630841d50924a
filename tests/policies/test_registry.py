"""Policies by their names, and directories in their place."""

import pytest
from tiny_policies import save_tiny

from swarm_mj.mission import paper, reference
from swarm_mj.policies.carrier_sense import AgeGainCsma, CarrierSense
from swarm_mj.policies.centralised import MinimumSpanningTree, RoundRobin
from swarm_mj.policies.greedy_oracle import GreedyOracle
from swarm_mj.policies.index.policy import IndexCsma
from swarm_mj.policies.learned import LearnedPolicy
from swarm_mj.policies.lookahead_oracle import LookaheadOracle
from swarm_mj.policies.planner.policy import Planner
from swarm_mj.policies.planner.resting import RestingPlanner
from swarm_mj.policies.random_access import Aloha, InnovationGossip, RandomFlooding
from swarm_mj.policies.registry import (
    FLOWN_AS,
    LISTED,
    POLICIES,
    TAKES_TURNS,
    flown_name,
    is_learned,
    make_policy,
    note_on,
    with_payload,
)
from swarm_mj.policies.sotdma.policy import SelfOrganisedTdma
from swarm_mj.policies.tdma import SpatialTdma, Tdma
from swarm_mj.policies.tuning import tuned_probability
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.packages import asset

MISSION = paper("flocking", num_robots=8)
REST = paper("stationary", num_robots=8)
SCHEDULES = ["round-robin", "tdma", "spatial-tdma", "sotdma", "planner", "planner --payload none"]
TUNED = ["random-flooding", "mst", "aloha", "csma", "gossip"]
here = pytest.mark.usefixtures("folder")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working directory with policies, two of them under names of others."""
    monkeypatch.chdir(tmp_path)
    for name in ("runs/x/policy", "mine", "mst", "all", "one.safetensors"):
        save_tiny(tmp_path / name, "paper")


@here
@pytest.mark.parametrize(
    "typed",
    ["runs/x/policy", "./runs//x/policy/", "runs/../mine", "mine/", "mst/", "./mst", "all"],
)
def test_a_folder_or_a_file_is_a_learned_policy_by_any_of_its_names(tmp_path, typed):
    for name in (typed, str(tmp_path / typed)):
        assert is_learned(name)
        assert isinstance(make_policy(name, MISSION), LearnedPolicy)


@here
def test_a_name_is_a_name_whatever_lies_about():
    assert make_policy("mst", MISSION).parameters["probability"] > 0.0


@here
@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("rumour", "or module:Name of your own, not 'rumour'"),
        ("", "or module:Name of your own, not ''"),
        ("mine.zip", r"store it with swarm_mj\.envs\.sb3\.save_policy"),
        ("./mine.zip", r"store it with swarm_mj\.envs\.sb3\.save_policy"),
        ("runs/y", r"there is no policy runs/y; name a \.safetensors file"),
    ],
)
def test_what_is_neither_a_name_nor_a_policy_on_disk(name, complaint):
    with pytest.raises(ValueError, match=complaint):
        make_policy(name, MISSION)


@here
def test_only_a_learned_policy_is_made_deterministic():
    for name in ("mine", "gnn"):
        policy = make_policy(name, MISSION, is_deterministic=True)
        assert policy.parameters["is_deterministic"] is True
    for name in POLICIES:
        if name != "gnn":
            with pytest.raises(ValueError, match=f"learned policies only, not to {name}"):
                make_policy(name, REST, is_deterministic=True)


@here
def test_the_shipped_policy_is_the_network_in_assets(tmp_path):
    save_tiny(tmp_path / "gnn", "paper")  # a folder of the same name is another policy
    shipped = make_policy("gnn", MISSION)
    assert is_learned("gnn")
    stored = make_policy(str(asset("policies/gnn.safetensors")), MISSION)
    assert shipped.parameters == stored.parameters
    assert (shipped.about, stored.about) == (LISTED["gnn"], None)  # others see by other features
    assert shipped.uses == LISTED["gnn"].uses
    assert shipped.parameters != make_policy("./gnn", MISSION).parameters


def test_ii_b_the_planner_can_go_without_payload():
    """A name typed with the option is the name of a policy of its own; others carry nothing."""
    assert with_payload(["tdma", "planner"], "none") == ["tdma", "planner --payload none"]
    assert with_payload(["planner --payload none"], "none") == ["planner --payload none"]
    assert with_payload(["tdma"], "snapshots") == ["tdma"]
    with pytest.raises(ValueError, match="but not those of tdma, mst; leave it out"):
        with_payload(["tdma", "mst"], "none")


KINDS = {
    "random-flooding": RandomFlooding,
    "mst": MinimumSpanningTree,
    "round-robin": RoundRobin,
    "aloha": Aloha,
    "csma": CarrierSense,
    "age-gain-csma": AgeGainCsma,
    "index-csma": IndexCsma,
    "gossip": InnovationGossip,
    "tdma": Tdma,
    "spatial-tdma": SpatialTdma,
    "sotdma": SelfOrganisedTdma,
    "planner": Planner,
    "planner --payload none": SpatialTdma,
    "greedy-oracle": GreedyOracle,
    "lookahead-oracle": LookaheadOracle,
}


@pytest.mark.parametrize("name", KINDS)
def test_policies_by_name_and_what_flies_moving_teams_and_those_at_rest(name):
    plans = name.startswith("planner")
    assert type(make_policy(name, MISSION)) is KINDS[name]
    assert type(make_policy(name, REST)) is (RestingPlanner if plans else KINDS[name])
    moving = "spatial-tdma" if name.endswith("none") else name
    assert (flown_name(name, REST), flown_name(name, MISSION)) == (name, moving)


@pytest.mark.parametrize(
    ("mission", "is_recomputed", "root_transmits"),
    [
        (paper("random-walk", num_robots=8), False, False),
        (reference("random-walk", num_robots=8), True, True),
        (reference("stationary", num_robots=8), False, True),
    ],
)
def test_iv_c_tree_is_the_presets(mission, is_recomputed, root_transmits):
    policy = make_policy("mst", mission, 1.0)
    assert (policy._is_recomputed, policy._root_transmits) == (is_recomputed, root_transmits)


@pytest.mark.parametrize("name", TUNED)
@pytest.mark.parametrize("preset", [paper, reference])
def test_probability_is_tuned_by_default_and_named(name, preset):
    mission = preset("random-walk", num_robots=20)
    parameters = make_policy(name, mission).parameters
    assert parameters == {"probability": tuned_probability(name, mission)}
    assert make_policy(name, mission, 0.17).parameters == {"probability": 0.17}


@pytest.mark.parametrize("name", [*SCHEDULES, "gnn"])
def test_a_schedule_has_no_probability(name):
    assert name == "gnn" or make_policy(name, REST).parameters == {}
    with pytest.raises(ValueError, match=f"{name} takes no transmission probability"):
        make_policy(name, REST, 0.5)


@pytest.mark.parametrize(
    ("name", "task", "num_robots", "note"),
    [
        ("planner", "stationary", 6, TAKES_TURNS),
        ("planner", "flocking", 6, TAKES_TURNS),
        ("planner", "stationary", 7, ""),
        ("planner --payload none", "stationary", 6, TAKES_TURNS),
        ("planner --payload none", "flocking", 6, FLOWN_AS),
        ("tdma", "flocking", 6, ""),
        ("mine:Policy", "flocking", 6, ""),
    ],
)
def test_a_policy_that_flies_otherwise_than_by_its_name_has_a_note(name, task, num_robots, note):
    assert note_on(name, paper(task, num_robots=num_robots)) == note


@pytest.mark.parametrize("task", ["stationary", "flocking"])
def test_the_planner_of_few_robots_flies_as_tdma(task):
    """As its note says."""
    mission = paper(task, num_robots=6, range_ratio=0.4, num_windows=30)
    ages: list[float] = []
    for name in ("planner", "tdma"):
        flight = rollout(Swarm(mission, [1]), make_policy(name, mission))
        ages.append(float(summarise(flight).aoi_mean[0]))
    assert ages[0] == ages[1]
