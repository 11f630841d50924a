"""What policies say of themselves, as plain values."""

import json
import math

import pytest

from swarm_mj.api.policy_facts import BROADCASTS, REQUEST, carried, facts_of
from swarm_mj.mission import paper
from swarm_mj.policies.registry import LISTED, make_policy

MISSION = paper("flocking")


@pytest.mark.parametrize(("name", "window"), [("tdma", BROADCASTS), ("mst", REQUEST)])
def test_a_policy_says_by_which_windows_it_talks(name, window):
    facts = facts_of(name, make_policy(name, MISSION), MISSION)
    assert facts["name"] == name
    assert facts["window"] == window
    assert facts["is_centralised"] == (name == "mst")
    assert json.loads(json.dumps(facts)) == facts


def test_a_packets_fields_add_up_to_its_bytes():
    facts = facts_of("planner", make_policy("planner", MISSION), MISSION)
    bits = sum(field["bits"] * field["count"] for field in facts["packet_fields"])
    assert math.ceil(bits / 8) == facts["packet_bytes"]
    assert facts["payload"] == LISTED["planner"].payload_name


def test_what_packets_carry_comes_with_its_meaning():
    assert carried(make_policy("planner", MISSION)).startswith("snapshots: ")
    assert carried(make_policy("tdma", MISSION)) == "none"


def test_a_name_that_another_policy_flies_by_keeps_its_own_words():
    """In a walk, `planner --payload none` flies as `spatial-tdma`, whose own words are others."""
    walk = paper("random-walk")
    name = "planner --payload none"
    facts = facts_of(name, make_policy(name, walk), walk)
    assert facts["uses"] == LISTED[name].uses
