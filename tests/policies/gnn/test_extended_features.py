"""Every extended feature by hand, on teams of a few robots, and laws; times are in windows."""

import copy
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mixed_missions import MISSION as WALK
from mixed_missions import NUM_ROBOTS, SEEDS, flown

from swarm_mj.mission import paper
from swarm_mj.policies.gnn.extended_features import ExtendedFeatures, LocalFeatures
from swarm_mj.policies.gnn.features_of_1_0 import FEATURES_OF_1_0
from swarm_mj.policies.gnn.turns import empty_beliefs, take_beliefs, write_turns
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.window import LocalViews, Phase

MISSION = paper("stationary", num_robots=4)
OBSERVER = 1  # the robot whose row is looked at
TEACHER = 3  # a robot that it knows, out of range
# Where robot 1 believes the others to be: 200 m, itself, unknown, 350 m.
BELIEVED_M = [[200.0, 0.0], [0.0, 0.0], [0.0, 0.0], [-210.0, -280.0]]
IS_KNOWN = [True, True, False, True]


def log_age(windows):
    return math.log(1 + windows) / math.log(501)


def buffers_of_robot_1(now):
    """It heard of robot 0 at 4, never of robot 2, of robot 3 at 6; it addressed robot 0 at 8."""
    buffers = empty_buffers(1, 4)
    buffers.timestamp[0, OBSERVER] = [4.0, now, 0.0, 6.0]
    buffers.position_m[0, OBSERVER] = BELIEVED_M
    buffers.parent[0, OBSERVER] = [1, -1, -1, 0]
    buffers.last_attempt[0, OBSERVER] = [8.0, 0.0, 0.0, 0.0]
    return buffers


def seen(views, mission=MISSION, robot=OBSERVER):
    """The features of each teammate by the name of their place, and whom it may address, at last.

    The names are those that stored policies know, and none of the code under test: two features
    that change places are both wrong.
    """
    extractor = ExtendedFeatures(mission)
    extractor.start(1, views[0].num_robots)
    for view in views:
        graphs = extractor.graphs(view)
    values = graphs.node[robot].T
    return dict(zip(FEATURES_OF_1_0["extended"], values, strict=True)), graphs.may_address[robot]


def silent_views(now=10.0):
    return [LocalViews(buffers=buffers_of_robot_1(now), now=np.array([now]), phases=())]


def check(found, **expected):
    for name, values in expected.items():
        np.testing.assert_allclose(found[name.replace("_", " ")], values, rtol=1e-6, err_msg=name)


def test_identity_knowledge_and_ages():
    found, _ = seen(silent_views())
    check(
        found,
        is_oneself=[0, 1, 0, 0],
        is_known=IS_KNOWN,
        age_of_T=[log_age(6), 0.0, 1.0, log_age(4)],
        age_of_last_attempt=[log_age(2), 1.0, 1.0, 1.0],
        age_of_last_packet_heard=[1.0] * 4,
        age_of_last_being_addressed=[1.0] * 4,
        share_of_the_team_known=[0.75] * 4,
        size_of_the_team=[0.1] * 4,
    )


@pytest.mark.parametrize("range_m", [250.0, 500.0])
@pytest.mark.parametrize(
    ("at_0", "at_3"), [(200.0, 350.0), (251.0, 299.0), (249.0, 301.0), (3000.0, 200.0)]
)
def test_distances_by_belief(at_0, at_3, range_m):
    """Up to 4 ranges count, and those up to 1.2 are worth addressing."""
    views = silent_views()
    views[0].buffers.position_m[0, OBSERVER] = [[at_0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, at_3]]
    mission = paper("stationary", num_robots=4, range_ratio=range_m / 1000.0)
    found, may_address = seen(views, mission)
    far_m = 4 * range_m
    check(found, distance=[min(at_0 / far_m, 1.0), 0.0, 0.0, at_3 / far_m])
    check(found, is_in_range=[at_0 < range_m, 0, 0, at_3 < range_m])
    assert may_address.tolist() == [at_0 < 1.2 * range_m, True, True, at_3 < 1.2 * range_m]


def test_neighbours_of_each_by_belief():
    """0 and 1 are 200 m apart; 3 is 350 m from 1 and farther from 0; nobody knows 2."""
    check(seen(silent_views())[0], neighbours=[0.1, 0.1, 0.0, 0.0])
    closer = silent_views()
    closer[0].buffers.position_m[0, OBSERVER, 3] = [-100.0, 0.0]
    check(seen(closer)[0], neighbours=[0.1, 0.2, 0.0, 0.1])


def check_turns(found, *apart_1_5_2_3, by_interference):
    names = [f"has a turn, {ranges} ranges apart" for ranges in ("1.5", "2", "3")]
    check(found, **dict(zip(names, apart_1_5_2_3, strict=True)))
    check(found, **{"has a turn, by interference": by_interference})


def started(kind=ExtendedFeatures, mission=MISSION):
    """Features of one team, or of the mixed missions."""
    extractor = kind(mission)
    extractor.start(*((1, 4) if mission is MISSION else (len(SEEDS), NUM_ROBOTS)))
    return extractor


def has_turn(view):
    """Whether each robot has a turn by its own beliefs."""
    return started().graphs(view).has_turn.tolist()


@pytest.mark.parametrize(
    ("now", "rank", "turns"),
    [
        (8.0, [0, 1, 2, 3], [1, 0, 0, 0]),  # 0 leads; 2 is next, who may be anywhere
        (9.0, [3, 0, 1, 2], [0, 1, 0, 0]),  # 1 leads; 3 is 1.4 ranges off, and 0 nearer
        (10.0, [2, 3, 0, 1], [0, 0, 0, 0]),  # 2 leads, who may be anywhere
    ],
)
def test_turns_go_by_the_clock_up_to_the_first_unknown_robot(now, rank, turns):
    found, _ = seen(silent_views(now))
    check(found, rank_of_its_turn=[r / 4 for r in rank])
    check_turns(found, turns, turns, turns, by_interference=turns)


def test_turns_by_distance_and_by_interference():
    """Robot 1 leads at the origin and is heard by 0; then 3, 0 and 2 are asked, in this order.

    Robot 3, 300 m off, is too near by distance, 2 at 400 m (1.6 ranges) is not. By interference 3
    may speak: in units of noise, 0 hears robot 1 with 1.259 (250/100)^2 = 7.9 over 1 + 0.5 from 3,
    and 2 hears 3 likewise. So neither 0 nor 2 may.
    """
    views = silent_views(9.0)
    views[0].buffers.timestamp[0, OBSERVER] = [4.0, 9.0, 5.0, 6.0]
    views[0].buffers.position_m[0, OBSERVER, :, 0] = [-100.0, 0.0, 400.0, 300.0]
    views[0].buffers.position_m[0, OBSERVER, :, 1] = 0.0
    alone = [0, 1, 0, 0]
    check_turns(seen(views)[0], [0, 1, 1, 0], alone, alone, by_interference=[0, 1, 0, 1])
    assert has_turn(views[0]) == [False, True, False, False]


def test_a_robot_has_the_turn_that_it_believes_it_has():
    """Robot 1 believes what robot 3 believed above, and so it, not the leader, is robot 3."""
    buffers = empty_buffers(1, 4)
    buffers.timestamp[0, 3] = [4.0, 5.0, 5.0, 9.0]
    buffers.position_m[0, 3, :, 0] = [-100.0, 0.0, 400.0, 300.0]
    view = LocalViews(buffers=buffers, now=np.array([9.0]), phases=())
    assert has_turn(view) == [False, True, False, True]
    buffers.position_m[0, 3, 0, 0] = 50.0  # robot 0 would lose what the leader tells it
    buffers.position_m[0, 3, 3, 0] = 120.0
    assert has_turn(view) == [False, True, False, False]


def phase(recipient, heard):
    return Phase(recipient=np.array([recipient]), heard=np.array([heard]))


def views_of_a_talk():
    """In window 10 robot 3 addresses robot 1, which answers; in window 11 robot 1 addresses 0.

    Robot 3 knows of itself and, from 9, of robot 2. Nobody decodes what robot 1 says in window 11.
    """
    before = buffers_of_robot_1(10.0)
    before.timestamp[0, TEACHER] = [3.0, 2.0, 9.0, 10.0]
    asked, answered = phase([0, 1, 2, 1], [0, 3, 2, 3]), phase([0, 3, 2, 3], [0, 1, 2, 1])
    after = buffers_of_robot_1(11.0)
    after.timestamp[0, OBSERVER] = [4.0, 11.0, 9.0, 10.5]
    after.position_m[0, OBSERVER, 2:] = [[0.0, 900.0], [-60.0, 80.0]]  # 3 is nearer, at 100 m
    last = copy.deepcopy(after)
    last.timestamp[0, OBSERVER, OBSERVER] = 12.0
    last.last_attempt[0, OBSERVER, 0] = 11.5
    spoke, nothing = phase([0, 0, 2, 3], [0, 1, 2, 3]), phase([0, 1, 2, 3], [0, 1, 2, 3])
    return [
        LocalViews(buffers=buffers, now=np.array([now]), phases=phases)
        for buffers, now, phases in [
            (before, 10.0, ()),
            (after, 11.0, (asked, answered)),
            (last, 12.0, (spoke, nothing)),
        ]
    ]


@pytest.mark.parametrize(("addressed", "is_meant"), [(OBSERVER, True), (2, False)])
def test_ages_of_packets_heard_and_meant_for_oneself(addressed, is_meant):
    """Robot 3's packet came at 10.5, and robot 1's own first word is at 11.5."""
    views = views_of_a_talk()
    views[1].phases[0].recipient[0, TEACHER] = addressed
    for num_views, own, since in ((2, 1.0, 0.5), (3, log_age(0.5), 1.5)):
        found, _ = seen(views[:num_views])
        of_3 = log_age(since)
        check(found, age_of_last_packet_heard=[1.0, own, 1.0, of_3])
        check(found, age_of_last_being_addressed=[1.0, 1.0, 1.0, of_3 if is_meant else 1.0])
    check(found, age_of_last_attempt=[log_age(0.5), 1.0, 1.0, 1.0])


def test_news_to_those_in_range():
    """Means of rises over 4 subjects; robot 0 was never heard, robot 3's T were [3, 2, 9, 10.5].

    Robot 1 spoke first at 11.5, with T = [4, 11.5, 9, 10.5]: all that is new since is 0.5 of its
    own clock.
    """
    names = ("news to it, by its last packet", "news to it, if it heard what was said last")
    before, after = (4 + 11 + 9 + 10.5, 1 + 9 + 0 + 0), (4 + 12 + 9 + 10.5, 1 + 10 + 0 + 0)
    for num_views, rises in ((2, (before, before)), (3, (after, (0.5, 0.5)))):
        found, _ = seen(views_of_a_talk()[:num_views])
        for name, (to_0, to_3) in zip(names, rises, strict=True):
            expected = [log_age(to_0 / 4), log_age((to_0 + to_3) / 4), 0.0, log_age(to_3 / 4)]
            np.testing.assert_allclose(found[name], expected, rtol=1e-6)


def test_the_local_features_are_the_extended_ones_without_turns():
    extended, local = started(mission=WALK), started(LocalFeatures, WALK)
    turns = range(10, 15)  # the rank, three by distance, one by interference
    kept = [k for k in range(18) if k not in turns]
    assert all("turn" in FEATURES_OF_1_0["extended"][k] for k in turns)
    for view in flown(6):
        graphs, fewer = extended.graphs(view), local.graphs(view)
        assert np.all((graphs.node >= 0.0) & (graphs.node <= 2.0))
        np.testing.assert_array_equal(fewer.node, graphs.node[:, :, kept])
        np.testing.assert_array_equal(fewer.may_address, graphs.may_address)
        np.testing.assert_array_equal(fewer.parent, graphs.parent)
        assert not np.any(fewer.has_turn)


# Turns by distance.

RADII = np.array([100.0, 150.0, 300.0])


def turns(believed_m, is_known, now, radius_m=RADII):
    """Who has a turn by one robot's beliefs [radius, robot]."""
    beliefs = empty_beliefs(len(is_known))
    take_beliefs(np.array(believed_m, dtype=float), np.array(is_known), beliefs)
    has_turn = np.full((len(radius_m), len(is_known)), 7.0, dtype=np.float32)
    for radius, its in zip(radius_m, has_turn, strict=True):
        write_turns(beliefs, now, radius, its)
    assert np.all((has_turn == 0.0) | (has_turn == 1.0))
    return has_turn == 1.0


def order(num_robots, now):
    """The leader, and from half a round on the others."""
    half = (now + num_robots // 2) % num_robots
    after = [*range(half, num_robots), *range(half)]
    return [now % num_robots, *(k for k in after if k != now % num_robots)]


def test_exactly_a_radius_apart_is_far_enough():
    assert turns([[0.0, 0.0], [100.0, 0.0]], [True] * 2, 0).tolist()[0] == [True, True]
    assert turns([[0.0, 0.0], [99.9, 0.0]], [True] * 2, 0).tolist()[0] == [True, False]


@st.composite
def teams(draw):
    num_robots = draw(st.integers(1, 12))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    is_known = rng.random(num_robots) < draw(st.sampled_from([0.8, 1.0]))
    return rng.uniform(-250.0, 250.0, (num_robots, 2)), is_known, draw(st.integers(0, 1000))


@given(teams())
def test_a_maximal_independent_set_of_those_asked(team):
    believed_m, is_known, now = team
    asked = order(len(is_known), now)
    first_unknown = [is_known[k] for k in asked].index(False) if not all(is_known) else len(asked)
    for radius_m, has_turn in zip(RADII, turns(believed_m, is_known, now), strict=True):
        assert not any(has_turn[asked[first_unknown:]])
        for place, k in enumerate(asked[:first_unknown]):
            apart_m = np.hypot(*(believed_m[asked] - believed_m[k]).T)
            is_in_its_way = has_turn[asked] & (apart_m < radius_m)
            if has_turn[k]:
                assert is_in_its_way.sum() == 1  # itself
            else:
                assert any(is_in_its_way[:place])
