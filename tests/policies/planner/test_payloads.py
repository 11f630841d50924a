"""The planner's payloads: their bytes by hand, and what fits into a slot."""

import re

import numpy as np
import pytest
from learning_reference import rounded

from swarm_mj.mission import paper
from swarm_mj.policies.planner.payloads import carries, check_room, link_fields
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.packets import packet_of


def holding(num_bytes, task="random-walk", **fields):
    """A mission whose slots of 50 ms hold so many bytes."""
    return paper(task, bit_rate=num_bytes * 160.0, **fields)


def test_snapshots_that_do_not_fit_to_the_byte_are_refused_with_the_ways_out():
    """`tests/protocol/test_packets.py` counts the 7,263 bytes by hand."""
    mission = holding(7263)
    policy = make_policy("planner", mission)
    assert policy.payload == "snapshots"
    assert policy.packet(mission).num_bytes == 7263
    message = (
        "packets of planner need 7,263 bytes, but a slot holds 7,262 bytes at 1.162 Mbit/s; "
        "choose a bit rate of 1.16208e+06 or more, or planner --payload none"
    )
    with pytest.raises(ValueError, match=re.escape(message)):
        check_room(holding(7262))
    with pytest.raises(ValueError, match=re.escape(message)):
        make_policy("planner", holding(7262))


def test_large_teams_at_rest_learn_without_a_plan_for_motion_where_snapshots_do_not_fit():
    """Of 200 robots: what is learned of links takes 117 kB or so, snapshots 164 kB."""
    mission = holding(140_000, "stationary", num_robots=200)
    with pytest.raises(ValueError, match="need 16"):
        check_room(mission)
    assert make_policy("planner", mission).payload == "links"


REST = paper("stationary")


def test_the_bytes_of_what_is_learned_of_links_by_hand():
    """Of 40 robots: the slot each plans since; 64 kinds of packets each, of a sender, one of 24
    bins, whether it was decoded and how often, up to 255 times; and two tables, with an owner, how
    much it knew, one of 8 laws, and two bytes for each of 780 links."""
    notes = 40 * 64 * (8 + 5 + 1 + 8)
    table = 8 + 32 + 3 + 780 * (8 + 8)
    bits = 40 * 16 + notes + 2 * table
    assert sum(field.num_bits for field in link_fields(REST)) == bits == 82_006
    assert packet_of(REST, link_fields(REST)).num_bytes == 367 + 10_251  # 82,006 / 8, rounded up


@pytest.mark.parametrize(("room", "payload"), [(10_618, "links"), (10_617, "none")])
def test_teams_at_rest_learn_if_slots_hold_it_to_the_byte(room, payload):
    """Else they fly as without a payload."""
    mission = holding(room, "stationary")
    policy = make_policy("planner", mission)
    assert carries(link_fields(mission), mission) == (payload == "links")
    assert policy.payload == payload
    assert policy.packet(mission).num_bytes == (10_618 if payload == "links" else 367)


def test_fields_of_tables_reach_over_all_that_is_told_apart():
    """Excess losses from -30 to 18 dB, and standard deviations below 48 dB, by 0.25 dB."""
    *_, mean, std = link_fields(REST)
    told_db = np.arange(-30.0, 18.1, 0.25)
    np.testing.assert_array_equal(rounded(mean, told_db), told_db)
    np.testing.assert_array_equal(rounded(std, told_db + 30.0), told_db + 30.0)
