import copy
import inspect
import math
from itertools import chain

import numpy as np
import pytest

from swarm_mj.mission import paper, reference
from swarm_mj.policies.carrier_sense import SensingPolicy
from swarm_mj.policies.centralised import MinimumSpanningTree
from swarm_mj.policies.policy import CentralisedPolicy, DecentralisedPolicy, packet_by
from swarm_mj.policies.random_access import Aloha, InnovationGossip, RandomFlooding
from swarm_mj.policies.registry import LISTED, POLICIES, make_policy
from swarm_mj.protocol.packets import PacketField
from swarm_mj.radio.carrier_sensing import Contention
from swarm_mj.simulation.swarm import Swarm

MISSION = paper("flocking", num_robots=8)
CENTRALISED = ["round-robin", "mst", "greedy-oracle", "lookahead-oracle"]
DECENTRALISED = [name for name in POLICIES if name not in CENTRALISED]
SENSING = ["csma", "age-gain-csma", "index-csma"]  # robots of these also know what they sense
# What robots learn from payload, or from others' T in packets, is in no view: the tests of these
# policies hold them to Eq. 9.
# What packets carry beyond T, M and P.
PAYLOAD = {name: about.payload_name for name, about in LISTED.items() if about.payload is not None}
VIEWED = [name for name in DECENTRALISED if name not in (*PAYLOAD, "sotdma", "index-csma")]
ROW = 3  # the robot whose knowledge the law keeps


def generators(num_missions=2):
    return [np.random.default_rng((9, b)) for b in range(num_missions)]


def real_views(seeds):
    """What two teams know after 5, 10, ..., 30 windows of random flooding."""
    swarm = Swarm(MISSION, seeds)
    talk = RandomFlooding(0.2)
    swarm.start(talk)
    views = []
    for window in range(1, 31):
        swarm.step(talk)
        if window % 5 == 0:
            views.append(copy.deepcopy(swarm.views))
    return views


def with_row_of(mine, theirs):
    """A copy of `theirs` in which `ROW` of every array within is `mine`'s."""
    mixed = copy.deepcopy(theirs)
    kept, replaced = (
        [*vars(views.buffers).values(), *chain(*views.phases)] for views in (mine, mixed)
    )
    for own, other in zip(kept, replaced, strict=True):
        if own.ndim > 1:  # by robots
            other[:, ROW] = own[:, ROW]
    return mixed


class Radio:
    """A radio that says to `ROW` what it senses, and to all others anything."""

    def __init__(self):
        self.asked = []  # of each slot: when `ROW` listens, and what holds it back
        self._rng = np.random.default_rng(6)  # of `ROW`
        self._others = np.random.default_rng()

    def __call__(self, contention):
        self.asked.append([each[:, ROW].tolist() for each in contention])
        is_idle = self._others.random(contention.minislot.shape) < 0.5
        is_idle[:, ROW] = self._rng.random(len(is_idle)) < 0.5
        return is_idle & np.isfinite(contention.minislot)


def decisions_of_row(policy, views):
    radio = Radio()
    if isinstance(policy, SensingPolicy):
        policy.listen(radio)
    policy.start(MISSION.num_robots, generators())
    return [policy.recipients(view)[:, ROW].tolist() for view in views], radio.asked


def knows_its_own_view_only(make):
    """Whether `ROW` decides as before when all that it cannot know is another team's (Eq. 9)."""
    mine, theirs = real_views([1, 2]), real_views([3, 4])
    mixed = [with_row_of(*pair) for pair in zip(mine, theirs, strict=True)]
    return decisions_of_row(make(), mine) == decisions_of_row(make(), mixed)


@pytest.mark.parametrize("name", VIEWED)
@pytest.mark.parametrize("preset", [paper, reference])
def test_eq9_a_decentralised_robot_decides_on_its_own_view(name, preset):
    assert knows_its_own_view_only(lambda: make_policy(name, preset(num_robots=8)))


class Heavy(DecentralisedPolicy):
    """Whose packets carry a map of 1000 bytes."""

    payload = "a map"

    def payload_fields(self, mission):
        return (PacketField(name="cell", bits=8, count=25 * mission.num_robots),)

    def recipients(self, views):
        return views.silence


def test_a_payload_counts_and_where_it_does_not_fit_the_policy_does_not_fly():
    """Beside 7 bytes of header and an entry of 9, whose 16 bytes are the least."""
    assert Heavy().packet(paper()).num_bytes == 367 + 1000
    fits = paper(bit_rate=1016 * 160.0)
    assert Heavy().packet(fits).num_entries == 1
    Swarm(fits, [1]).start(Heavy())
    with pytest.raises(ValueError, match="packets of Heavy need 1,016 bytes for a single entry"):
        Swarm(paper(bit_rate=1015 * 160.0), [1]).start(Heavy())


@pytest.mark.parametrize("name", DECENTRALISED)
def test_eq9_a_decentralised_policy_is_not_told_the_truth(name):
    """Its type has no states, and where the robots truly are does not change what it decides.

    Robots that sense decide when they listen, and from which power they hold back.
    """
    policy = make_policy(name, MISSION)
    radios = []
    assert list(inspect.signature(policy.recipients).parameters) == ["views"]
    decisions = []
    for scale in (1.0, 0.5):
        swarm = Swarm(MISSION, [1, 2])
        swarm._physics.place(scale * swarm.states.position_m, scale * swarm.states.velocity_mps)
        swarm.start(policy)
        if name in SENSING:
            radios.append(Radio())
            policy.listen(radios[-1])
            swarm.decide()
            decisions.append(radios[-1].asked)
        else:
            decisions.append(swarm.decide())
    np.testing.assert_array_equal(*decisions)


class MostIsolated(DecentralisedPolicy):
    """Decentralised by its type only: everyone addresses the robot that knows the fewest."""

    def recipients(self, views):
        num_known = np.sum(views.buffers.is_known, axis=2)
        return views.silence * 0 + np.argmin(num_known, axis=1)[:, None]


class FirstToListen(SensingPolicy):
    """Decentralised by its type only: everyone listens when robot 0's news is old."""

    def contend(self, views):
        minislot = views.silence + views.buffers.timestamp[:, :1, 1]
        return Contention(minislot, np.zeros_like(minislot))


class LoudestLastWindow(DecentralisedPolicy):
    """Decentralised by its type only: everyone addresses whom robot 0 decoded."""

    def recipients(self, views):
        return views.silence * 0 + views.phases[0].heard[:, :1]


@pytest.mark.parametrize("cheat", [MostIsolated, LoudestLastWindow, FirstToListen])
def test_eq9_the_law_above_tells_cheats(cheat):
    assert not knows_its_own_view_only(cheat)


@pytest.mark.parametrize("name", POLICIES)
def test_ii_b_every_named_policy_is_of_one_kind_and_says_what_packets_carry(name):
    policy = make_policy(name, MISSION)
    assert isinstance(policy, CentralisedPolicy) == (name in CENTRALISED)
    assert policy.is_centralised == (name in CENTRALISED)
    assert isinstance(policy, DecentralisedPolicy) == (name in DECENTRALISED)
    assert policy.payload == PAYLOAD.get(name, "none")
    assert policy.carries_more == (name in PAYLOAD)
    assert PAYLOAD["planner"] == "snapshots"


def flown(mission, seeds, policy):
    """Whom everyone addresses [slot, mission, robot]."""
    swarm, slots = Swarm(mission, seeds), []
    for _ in range(40):
        swarm.step(policy)
        slots += [phase.recipient for phase in swarm.phases]
    return np.stack(slots)


@pytest.mark.parametrize(
    ("name", "mission"),
    [
        *((name, MISSION) for name in POLICIES),
        *((name, paper("stationary", num_robots=8)) for name in POLICIES if "planner" in name),
    ],
)
def test_a_mission_does_not_depend_on_those_next_to_it_and_before(name, mission):
    """One policy flies them together, then one of them alone."""
    policy = make_policy(name, mission)
    three, alone = (flown(mission, seeds, policy) for seeds in ([5, 6, 7], [6]))
    np.testing.assert_array_equal(three[:, 1], alone[:, 0])
    assert np.any(three[:, 0] != three[:, 1])


@pytest.mark.parametrize("kind", [Aloha, InnovationGossip, MinimumSpanningTree, RandomFlooding])
@pytest.mark.parametrize("probability", [-0.01, 1.01, math.nan])
def test_a_bad_probability_is_a_clear_error(kind, probability):
    options = {"range_m": 1.0} if kind is Aloha else {}
    with pytest.raises(ValueError, match=f"probability must be from 0 to 1, not {probability!r}"):
        kind(probability, **options)


def test_a_packet_is_what_the_policy_says_and_must_be_one():
    policy = make_policy("tdma", MISSION)
    assert packet_by(policy, MISSION) == policy.packet(MISSION)
    policy.packet = lambda _mission: 66
    with pytest.raises(ValueError, match="must return a Packet, not 66"):
        packet_by(policy, MISSION)
    with pytest.raises(TypeError, match="policy"):
        packet_by("tdma", MISSION)
