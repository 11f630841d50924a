import copy
import math

import numpy as np
import pytest
from decentralised_reference import transmitters
from standing_teams import view_of

from swarm_mj.mission import paper, reference
from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.sotdma import policy as sotdma_policy
from swarm_mj.policies.sotdma.frame import frame_slots
from swarm_mj.policies.sotdma.policy import SotdmaTeam
from swarm_mj.policies.sotdma.slot_table import LONG_AGO, NO_PLACE, place_of
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.radio.mission_radio import Belief, radio_of
from swarm_mj.simulation.swarm import Swarm

REST = paper("stationary", num_robots=12, range_ratio=0.2)
FIRST = 36  # the first slot of a frame, of 11 slots


def flown(mission, seeds, num_windows):
    """Who transmits in each slot [slot, mission, robot], and the policy."""
    policy = make_policy("sotdma", mission)
    return transmitters(Swarm(mission, seeds), policy, num_windows), policy


class Apart(BroadcastPolicy):
    """A flight in which some robots are also asked apart, by their own views and packets alone."""

    def __init__(self, mission, robots):
        self.policy = make_policy("sotdma", mission)
        self.minds = {i: make_policy("sotdma", mission) for i in robots}

    def start(self, num_robots, rngs):
        for mind in self.minds.values():
            mind.start(num_robots, copy.deepcopy(rngs))
        self.policy.start(num_robots, rngs)

    def transmits(self, views):
        decided = self.policy.transmits(views)
        for i, mind in self.minds.items():
            np.testing.assert_array_equal(
                decided[:, i], mind.transmits(self.as_seen_by(i, views))[:, i]
            )
        return decided

    @staticmethod
    def as_seen_by(i, views):
        """All that is not robot i's is lost, but T and P of whom it decoded in the last slot."""
        seen = copy.deepcopy(views)
        for array in vars(seen.buffers).values():
            if array.ndim > 1:  # by robots
                array[:, np.arange(views.num_robots) != i] = 0
        for phase, true in zip(seen.phases, views.phases, strict=True):
            phase.heard[...] = phase.recipient[...] = np.arange(views.num_robots)
            phase.heard[:, i] = true.heard[:, i]
            phase.recipient[:, i] = true.recipient[:, i]
        if seen.phases:
            for b, sender in enumerate(seen.phases[-1].heard[:, i]):
                seen.buffers.timestamp[b, sender] = views.buffers.timestamp[b, sender]
                seen.buffers.parent[b, sender] = views.buffers.parent[b, sender]
        return seen


@pytest.mark.parametrize(
    ("preset", "task"), [(paper, "stationary"), (paper, "random-walk"), (reference, "stationary")]
)
def test_eq9_robots_decide_by_their_buffers_and_by_t_and_p_in_packets(preset, task):
    mission = preset(task, num_robots=8, range_ratio=0.2)
    swarm, apart = Swarm(mission, [1, 2]), Apart(mission, [0, 5])
    swarm.start(apart)
    for _ in range(80):
        swarm.step(apart)


def test_eq9_robots_that_share_a_slot_choose_it_by_their_own_memory():
    """Of 16 robots 13 have a slot by the order; robot 6 comes last in it, and so chooses."""
    mission = paper("random-walk", num_robots=16, range_ratio=0.2)
    swarm, apart = Swarm(mission, [1, 2]), Apart(mission, [6])
    swarm.start(apart)
    assert frame_slots(16) == 13
    assert [team._order[-1] for team in apart.policy._teams] == [6, 6]
    for _ in range(60):
        swarm.step(apart)


def test_it_begins_as_spatial_tdma_then_everyone_transmits_once_in_every_frame_in_its_own_slot():
    slots, policy = flown(REST, [3], 100)
    turns = transmitters(Swarm(REST, [3]), make_policy("spatial-tdma", REST), FIRST // 2)
    np.testing.assert_array_equal(slots[:FIRST], turns)
    rule = policy._teams[0]._rule
    assert policy._teams[0]._frames_begin == FIRST
    places = np.array([place_of(slot, rule) for slot in range(200 - FIRST)])
    sent = slots[FIRST:, 0]
    frame = np.cumsum(places == 0)[places != NO_PLACE]
    counts = [np.sum(sent[places != NO_PLACE][frame == n], axis=0) for n in range(1, 13)]
    # Whoever moves to a later slot of the frame in which it chooses transmits twice in it, or not
    # at all if to an earlier one.
    assert np.mean(np.array(counts) == 1) > 0.9
    assert np.all(np.sum(counts, axis=0) >= 10)
    own = np.diagonal(policy._teams[0].table.slots)
    last = [np.flatnonzero(sent[:, i] & (places != NO_PLACE))[-1] for i in range(12)]
    np.testing.assert_array_equal(places[last], own)


def test_robots_agree_on_slots():
    """Within a frame of the last choice almost everyone knows everyone's slot."""
    _, policy = flown(REST, [3, 4, 5], 150)
    for team in policy._teams:
        slots = team.table.slots
        assert np.mean(slots == np.diagonal(slots)) > 0.9


@pytest.mark.parametrize("task", ["stationary", "flocking"])
def test_eq10_news_is_younger_than_by_turns(task):
    """Of 16 robots, after the start, over 150 windows: the mean of three missions."""
    mission, age = paper(task, num_robots=16), {}
    for name in ("sotdma", "spatial-tdma", "tdma"):
        swarm, policy = Swarm(mission, [0, 1, 2]), make_policy(name, mission)
        swarm.start(policy)
        age[name] = np.mean([swarm.step(policy).age_windows for _ in range(150)][30:])
    assert age["sotdma"] < 0.95 * age["spatial-tdma"] < age["tdma"]


def test_packets_that_hold_a_part_of_t_tell_nothing_of_who_was_heard():
    mission = paper("stationary", num_robots=12, range_ratio=0.2, bit_rate=10_000.0)
    for each, tells in ((mission, False), (REST, True)):
        _, policy = flown(each, [1], 60)
        assert np.any(policy._teams[0].table.decoded > LONG_AGO) == tells


NUM_ROBOTS = 12
ORDER = np.random.default_rng(0).permutation(NUM_ROBOTS)
SILENCE, NO_DRAW = np.arange(NUM_ROBOTS), np.ones(NUM_ROBOTS)
RADIO = radio_of(paper("stationary"))  # decodes up to 250 m in silence


def row():
    """All know where all are, 200 m apart, since t = 1, and observe themselves now, at t = 5."""
    timestamp = np.where(np.eye(NUM_ROBOTS), 5.0, 1.0)
    return view_of(timestamp, np.outer(200.0 * SILENCE, [1.0, 0.0]))


def asked(team, view, slot, in_turn=SILENCE < 0, draw=NO_DRAW):
    """Who transmits in a slot by what robots know."""
    return team.transmits(view._replace(now=slot * SLOT_WINDOWS), in_turn, draw)


def begun(view):
    """A team in its first frame."""
    team = SotdmaTeam(ORDER, Belief(radio=RADIO))
    in_turn = SILENCE == 3
    for slot in (0, FIRST - 1):
        np.testing.assert_array_equal(asked(team, view, slot, in_turn), in_turn)
    assert team.table is None
    asked(team, view, FIRST, in_turn)
    assert team.table is not None
    return team


def test_frames_grow_with_the_root_of_the_team_and_are_never_longer_than_a_round():
    assert [frame_slots(n) for n in (2, 5, 10, 20, 40, 80)] == [2, 5, 10, 14, 20, 29]


def test_robots_choose_in_common_order_from_the_second_frame_on(monkeypatch):
    """Twelve robots choose once each in the 44 slots of four frames of 11."""
    team, chose = begun(row()), []
    assert team._rule.num_slots == 11
    monkeypatch.setattr(
        sotdma_policy, "chosen", lambda i, slots, **_: chose.append((n, i)) or slots[i]
    )
    for n in range(1, 88):
        asked(team, row(), FIRST + n)
    assert [i for n, i in chose if n >= 44] == ORDER.tolist()
    assert min(chose)[0] >= 11


def test_robots_transmit_in_their_own_slots():
    view = row()
    view.position_m[5] = view.position_m[5, ::-1].copy()
    team = begun(view)
    slots = team.table.slots
    for slot in range(FIRST + 1, FIRST + 11):
        transmits = asked(team, view, slot)
        np.testing.assert_array_equal(transmits, np.diagonal(slots) == slot - FIRST)
        np.testing.assert_array_equal(team.table.sent == slot - FIRST, transmits)


def test_a_robot_that_chooses_knows_first_slots_of_all_who_announced_none():
    """The first choice comes after a frame, in which robot 3 was heard in slot 2."""
    team = begun(row())
    i = int(ORDER[0])
    team.table.announced[i, 3], team.table.slots[i, 3] = 2, 2
    expected = team._first_slots.of(i, SILENCE >= 0).copy()
    expected[3] = 2
    team._complete(team.table, i, SILENCE >= 0)
    np.testing.assert_array_equal(team.table.slots[i], expected)


def test_teams_too_large_for_first_slots_are_refused():
    with pytest.raises(ValueError, match=r"up to 250 robots, not of 1,000: .*spatial-tdma"):
        make_policy("sotdma", paper("stationary", num_robots=1000))
    make_policy("sotdma", paper("stationary", num_robots=250))


def test_robots_in_need_contend_where_nobody_owns_the_slot():
    """Robots 200 m apart in a row hear their neighbours; all but robots 0 and 1 heard of both of
    theirs a slot ago. Of those in need, the draw picks some."""
    view = row()
    slot = FIRST + 15  # the first of no frame
    assert place_of(15, begun(view)._rule) == NO_PLACE
    now = (slot + 1) / 2
    view.timestamp[...] = np.where(np.abs(SILENCE[:, None] - SILENCE) <= 1, now - 0.5, 1.0)
    lost = now - math.ceil(3.0 * 11) / 2 - 1.0  # a bit more than three frames of 11 slots
    view.timestamp[0, 1] = view.timestamp[1, 0] = lost
    for draw, expected in ((0.39, [0, 1]), (0.41, [])):
        transmits = asked(begun(row()), view, slot, draw=np.full(NUM_ROBOTS, draw))
        assert np.flatnonzero(transmits).tolist() == expected
