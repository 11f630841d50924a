import re

import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.planner.policy import Planner
from swarm_mj.policies.planner.resting import RestingPlanner
from swarm_mj.policies.registry import make_policy


@pytest.mark.parametrize(
    ("task", "kind", "payload"),
    [
        ("random-walk", Planner, "snapshots"),
        ("flocking", Planner, "snapshots"),
        ("stationary", RestingPlanner, "links"),
    ],
)
def test_teams_that_move_share_snapshots_and_those_at_rest_what_they_learn(task, kind, payload):
    policy = Planner.for_mission(paper(task, num_robots=8))
    assert type(policy) is kind
    assert policy.payload == payload


def test_ii_b_snapshots_that_do_not_fit_to_the_byte_are_refused_with_the_ways_out():
    """`tests/protocol/test_packets.py` counts the 7,263 bytes by hand."""
    mission = paper("random-walk", bit_rate=7263 * 160.0)  # slots of 50 ms
    policy = make_policy("planner", mission)
    assert policy.window(mission).is_broadcast
    assert policy.packet(mission).num_bytes == 7263
    message = (
        "packets of planner need 7,263 bytes, but a slot holds 7,262 bytes at 1.162 Mbit/s; "
        "choose a bit rate of 1162080 or more, or planner --payload none"
    )
    with pytest.raises(ValueError, match=re.escape(message)):
        make_policy("planner", paper("random-walk", bit_rate=7262 * 160.0))
