"""Whose turn it is: a maximal independent set of the known, the clock's robot first."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from swarm_mj.policies.gnn.extended_features import write_turns

RADII = np.array([100.0, 150.0, 300.0])


def turns(believed_m, is_known, now, radius_m=RADII):
    """Who has a turn by one robot's beliefs [radius, robot]."""
    x_m, y_m = np.array(believed_m, dtype=float).T.copy()
    has_turn = np.full((len(radius_m), len(is_known)), 7.0, dtype=np.float32)
    for radius, its in zip(radius_m, has_turn, strict=True):
        write_turns(x_m, y_m, np.array(is_known), now, np.full(len(its), 7.0), radius, its)
    assert np.all((has_turn == 0.0) | (has_turn == 1.0))
    return has_turn == 1.0


def order(num_robots, now):
    """The leader, and from half a round on the others."""
    half = (now + num_robots // 2) % num_robots
    after = [*range(half, num_robots), *range(half)]
    return [now % num_robots, *(k for k in after if k != now % num_robots)]


def test_turns_by_hand():
    """On a line, 80 m apart; robot 2 leads in window 2, then 0, 1 and 3 are asked."""
    believed_m = [[0.0, 0.0], [80.0, 0.0], [160.0, 0.0], [240.0, 0.0]]
    assert turns(believed_m, [True] * 4, 2).tolist() == [
        [True, False, True, False],  # 0 is 160 m off, 1 and 3 are near
        [True, False, True, False],
        [False, False, True, False],
    ]
    assert turns(believed_m, [True] * 4, 7).tolist() == [
        [False, True, False, True],  # 3 leads; 1 is asked first and 160 m off
        [False, True, False, True],
        [False, False, False, True],
    ]


def test_nobody_joins_after_a_robot_of_unknown_position():
    """In window 2 robot 0 is asked before 3, which is far from everyone."""
    believed_m = [[0.0, 0.0], [80.0, 0.0], [160.0, 0.0], [900.0, 0.0]]
    alone = [[False, False, True, False]] * 3
    assert turns(believed_m, [False, True, True, True], 2).tolist() == alone
    assert not np.any(turns(believed_m, [True, True, False, True], 2))
    after_0 = turns(believed_m, [True, False, True, True], 2).tolist()
    assert after_0 == [[True, False, True, False]] * 2 + [[False, False, True, False]]


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


@given(teams())
def test_everyone_leads_once_in_n_windows(team):
    """Whoever leads has a turn at any radius; at a huge one, nobody else has."""
    believed_m, _, now = team
    num_robots = len(believed_m)
    everyone = np.ones(num_robots, dtype=bool)
    for window in range(now, now + num_robots):
        has_turn = turns(believed_m, everyone, window, np.array([100.0, 1e6]))
        assert np.all(has_turn[:, window % num_robots])
        assert has_turn[1].sum() == 1


@given(teams())
def test_where_unknown_robots_are_believed_to_be_does_not_matter(team):
    believed_m, is_known, now = team
    elsewhere_m = np.where(is_known[:, None], believed_m, 0.0)
    np.testing.assert_array_equal(
        turns(believed_m, is_known, now), turns(elsewhere_m, is_known, now)
    )
