"""Snapshots in packets: what they weigh, which form fits into a slot, and what arrives."""

import re

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.planner.payloads import (
    lean_form,
    link_fields,
    links_fit,
    snapshot_form,
    whole_form,
)
from swarm_mj.policies.planner.settings import SnapshotSettings
from swarm_mj.policies.planner.snapshots import take_snapshots
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.packets import packet_of
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm

WALK = paper("random-walk")


def holding(num_bytes, **fields):
    """A mission whose slots of 50 ms hold so many bytes."""
    return paper("random-walk", bit_rate=num_bytes * 160.0, **fields)


def test_the_bytes_of_two_lean_snapshots_by_hand():
    """Owner, known, spread, lately, mean age; 40 ages of 1 byte and positions of 3: 177 bytes."""
    snapshot = 1 + 5 + 2 + 5 + 4 + 40 * 1 + 40 * 3
    assert packet_of(WALK, lean_form(WALK).fields).num_bytes == 367 + 2 * snapshot == 721


@pytest.mark.parametrize(
    ("room", "payload"),
    [(7263, "snapshots"), (7262, "lean snapshots"), (721, "lean snapshots")],
)
def test_the_richest_form_that_fits_to_the_byte(room, payload):
    mission = holding(room)
    policy = make_policy("planner", mission)
    assert policy.payload == payload
    assert policy.packet(mission).num_bytes <= room


def test_what_does_not_fit_is_refused_with_the_ways_out():
    message = (
        "packets of planner need 721 bytes at least, but a slot holds 720 bytes at 115.2 kbit/s; "
        "choose a bit rate of 115360 or more, or planner --payload none"
    )
    with pytest.raises(ValueError, match=re.escape(message)):
        snapshot_form(holding(720))


def test_a_rate_at_which_nothing_fits_is_not_told_to_fly_without_a_payload():
    least = "need 721 bytes at least, .* choose a bit rate of 115360 or more"
    with pytest.raises(ValueError, match=least) as caught:
        snapshot_form(paper("random-walk", bit_rate=10.0))
    assert "--payload" not in str(caught.value)


def snapshots_of_three(now):
    """Robot 2 has not heard of robot 0."""
    position_m = np.array([[[0.07, 0.0], [123.4, -400.0], [30.0, 40.0]]] * 3)
    timestamp = np.array([[now, 3.5, 8.0], [7.5, now, 8.0], [0.0, 9.0, now]])
    velocity_mps = np.array([[[1.0, 0.0], [0.0, -2.0], [0.5, 0.5]]] * 3)
    return take_snapshots(
        *(position_m, velocity_mps, timestamp, timestamp > 0.0, now, 0.1, 4.0),
        SnapshotSettings(),
    )


def test_lean_snapshots_arrive_rounded_and_whole_ones_as_they_are():
    taken, form = snapshots_of_three(10.0), lean_form(WALK)
    assert whole_form(WALK).arrived(taken, 10.0, 4.0) is taken
    come = form.arrived(taken, 10.0, 4.0)
    assert form.position.step == pytest.approx(0.244, abs=1e-3)  # 1 km by 4095
    assert np.abs(come.position_m - taken.position_m).max() <= form.position.step / 2 + 1e-9
    assert come.timestamp[0].tolist() == [10.0, 4.0, 8.0]  # 6.5 windows are told as 6
    # What is 6 windows old, not 6.5, will have erred for 10 of 10.5 windows.
    np.testing.assert_allclose(come.position_std_m[0, 1], taken.position_std_m[0, 1] * 10.0 / 10.5)
    np.testing.assert_array_equal(come.rank, taken.rank)
    again = form.arrived(come, 10.0, 4.0)
    np.testing.assert_array_equal(again.position_m, come.position_m)
    np.testing.assert_array_equal(again.timestamp, come.timestamp)


def test_robots_that_rest_are_still_certain_of_their_places():
    rests = paper("stationary", num_robots=8, num_windows=60, range_ratio=0.5)
    ages = []
    for rate in (None, 160.0 * packet_of(rests, lean_form(rests).fields).num_bytes):
        mission = paper("stationary", num_robots=8, num_windows=60, range_ratio=0.5, bit_rate=rate)
        policy = make_policy("planner", mission)
        ages.append(summarise(rollout(Swarm(mission, [1, 2]), policy)).aoi_mean.mean())
    assert ages[1] < 1.3 * ages[0]


def test_walking_teams_lose_little_by_lean_snapshots():
    """Over 6 missions: 5.0 windows with whole ones, 5.5 with lean ones, 6.0 without any."""
    ages = {}
    for name, rate in (("planner", None), ("planner", 50e3), ("planner --payload none", 50e3)):
        mission = paper("random-walk", num_robots=12, num_windows=200, bit_rate=rate)
        policy = make_policy(name, mission)
        summary = summarise(rollout(Swarm(mission, range(6)), policy))
        ages[policy.payload] = summary.aoi_mean.mean()
    assert ages["lean snapshots"] < 1.15 * ages["snapshots"]
    assert ages["lean snapshots"] < ages["none"]


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
    mission = paper("stationary", bit_rate=room * 160.0)
    policy = make_policy("planner", mission)
    assert links_fit(mission) == (payload == "links")
    assert policy.payload == payload
    assert policy.packet(mission).num_bytes == (10_618 if payload == "links" else 367)


def test_fields_of_tables_reach_over_all_that_is_told_apart():
    """Excess losses from -30 to 18 dB, and standard deviations below 48 dB, by 0.25 dB."""
    *_, mean, std = link_fields(REST)
    told_db = np.arange(-30.0, 18.1, 0.25)
    np.testing.assert_array_equal(mean.rounded(told_db), told_db)
    np.testing.assert_array_equal(std.rounded(told_db + 30.0), told_db + 30.0)
