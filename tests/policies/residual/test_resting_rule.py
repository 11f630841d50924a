"""The rule against the planner that it is taken from, and against its own later words."""

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.residual.resting_rule import FARTHEST, MOST_PLANS, RestingRule
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.radio.link_models import Belief
from swarm_mj.radio.mission_radio import belief_of, radio_of
from swarm_mj.radio.power_law import power_law
from swarm_mj.swarm import Swarm

REST = paper("stationary", num_robots=8, range_ratio=0.3)
RADIO = radio_of(REST)
PLANNER = "planner --payload none"


class Flown(BroadcastPolicy):
    """The rule alone; keeps what it proposed."""

    uses = "its buffer"

    def __init__(self, mission):
        self.rule, self.said = RestingRule(radio_of(mission)), []

    def inform(self, belief):
        self.rule.inform(belief)

    def start(self, num_robots, rngs):
        self.rule.start(num_robots, rngs)

    def transmits(self, views):
        self.said.append(self.rule.propose(views))
        return self.said[-1].transmits


def transmitters(mission, policy, num_windows):
    swarm, rows = Swarm(mission, [1, 2]), []
    swarm.start(policy)
    for _ in range(num_windows):
        swarm.step(policy)
        rows += [phase.recipient != np.arange(mission.num_robots) for phase in swarm.phases]
    return np.array(rows), swarm


@pytest.mark.parametrize("channel", [{}, {"erasure": 0.3}, {"arena": "blocks", "known": "map"}])
def test_it_is_the_planner_without_payload(channel):
    mission = paper("stationary", num_robots=8, range_ratio=0.3, **channel)
    flown, _ = transmitters(mission, Flown(mission), 50)
    planned, _ = transmitters(mission, make_policy(PLANNER, mission), 50)
    np.testing.assert_array_equal(flown, planned)


def test_the_plan_is_in_force_with_whoever_has_heard_of_everyone():
    """Before that, turns; and then all that have say the same of everyone."""
    policy = Flown(REST)
    swarm = Swarm(REST, [1, 2])
    swarm.start(policy)
    num_mixed = 0
    for _ in range(20):
        knows_all = np.all(swarm.buffers.is_known, axis=2)
        swarm.step(policy)
        first = policy.said[-2]
        np.testing.assert_array_equal(first.is_agreed, knows_all)
        for b in range(2):
            agreed = first.is_due[b, knows_all[b]]
            assert np.all(agreed == agreed[:1])
            in_turn = first.is_due[b, ~knows_all[b]]
            assert np.all(in_turn == in_turn[:1])
            assert np.all(np.sum(in_turn, axis=1) == 1)
            num_mixed += 0 < np.sum(knows_all[b]) < 8
    assert num_mixed > 0
    assert np.all(knows_all)


def test_due_in_comes_true():
    """Once all have heard of everyone: in how many slots each transmits next."""
    policy = Flown(REST)
    flown, _ = transmitters(REST, policy, 60)
    start = 1 + max(slot for slot, said in enumerate(policy.said) if not np.all(said.is_agreed))
    num_checked = 0
    for slot in range(start, 120 - FARTHEST):
        due_in = policy.said[slot].due_in
        assert np.all(due_in == due_in[:, :1])
        for b in range(2):
            for j in range(8):
                later = flown[slot + 1 : slot + 1 + FARTHEST, b, j].tolist()
                expected = 1 + later.index(True) if True in later else 1 + FARTHEST
                assert due_in[b, 0, j] == expected
                num_checked += 1
    assert num_checked > 300


def standing(seed, now=4.0):
    """What robots know that have heard where everyone stands."""
    buffers = empty_buffers(1, 8)
    buffers.timestamp[...] = 1.0
    buffers.position_m[...] = np.random.default_rng(seed).uniform(-300.0, 300.0, (8, 2))
    return LocalViews(buffers=buffers, now=np.array([now]), phases=())


def propose(rule, views):
    rule.start(8, [np.random.default_rng(0)])
    return rule.propose(views)


def assert_same(one, other):
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


def test_plans_are_made_once_for_positions_that_come_again():
    rule = RestingRule(RADIO)
    first = propose(rule, standing(1))
    assert len(rule._plans) == 1
    propose(rule, standing(2))
    plans = list(rule._plans.values())
    assert len(plans) == 2
    assert_same(propose(rule, standing(1)), first)
    assert all(kept is plan for kept, plan in zip(rule._plans.values(), plans, strict=True))


def test_who_is_never_due_is_due_beyond_the_last_slot():
    """Robot 7 stands where nobody would hear it."""
    views = standing(1)
    views.buffers.position_m[0, :, 7] = 1e6
    due_in = propose(RestingRule(RADIO), views).due_in[0, 0]
    assert due_in[7] == 1 + FARTHEST
    assert np.all(due_in[:7] < FARTHEST)


def test_plans_are_of_what_is_believed_of_the_channel():
    """Whatever was believed in free space before."""
    rule, views = RestingRule(RADIO), standing(1)
    free_space = propose(rule, views)
    rule.inform(belief_of(REST))
    assert_same(propose(rule, views), free_space)
    law = power_law(np.full(8, 9.0 * RADIO.received_at_1_m_mw))
    told, fresh = Belief(radio=RADIO, law=law), RestingRule(RADIO)
    for each in (rule, fresh):
        each.inform(told)
    assert_same(propose(rule, views), propose(fresh, views))
    assert not np.array_equal(propose(rule, views).due_in, free_space.due_in)


def test_plans_are_forgotten_before_they_are_too_many():
    rule = RestingRule(RADIO)
    propose(rule, standing(1))
    plan = next(iter(rule._plans.values()))
    for n in range(MOST_PLANS - 1):
        rule._plans[str(n).encode()] = plan
    propose(rule, standing(1))
    assert len(rule._plans) == MOST_PLANS
    propose(rule, standing(2))
    assert len(rule._plans) == MOST_PLANS + 1
    propose(rule, standing(3))
    assert len(rule._plans) == 1
