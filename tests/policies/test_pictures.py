import copy
import math
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from standing_teams import after_windows, flooded_team

from swarm_mj.mission import paper
from swarm_mj.policies.pictures import Pictures, epoch_windows, freeze, make_plan
from swarm_mj.policies.schedule import greedy_schedule, links_between

seeds = st.integers(0, 2**32 - 1)
NOW = 20.0


def frozen_by_hand():
    """Three robots at t = 20, pictures for 8 windows of 0.1 s ahead.

    Robot 0 has heard of 1 at t = 14, robot 2 of 0 at t = 16, robot 1 of 0 at t = 8 and 2 at t = 18.
    What they have not heard of must not count, whatever is written there.
    """
    timestamp = np.array([[20.0, 14.0, 0.0], [8.0, 20.0, 18.0], [16.0, 0.0, 20.0]])
    position_m = np.array(
        [
            [[0.0, 0.0], [100.0, 50.0], [0.0, 0.0]],
            [[10.0, 20.0], [30.0, 40.0], [50.0, 60.0]],
            [[1.0, 2.0], [0.0, 0.0], [3.0, 4.0]],
        ]
    )
    velocity_mps = np.array(
        [
            [[1.0, 0.0], [3.0, 4.0], [90.0, 90.0]],
            [[2.0, 2.0], [2.0, 2.0], [2.0, -1.0]],
            [[0.0, 5.0], [90.0, 90.0], [0.0, 5.0]],
        ]
    )
    return freeze(position_m, velocity_mps, timestamp, timestamp > 0.0, NOW, 0.1, 8.0)


def test_positions_go_on_with_their_velocity_by_hand():
    """For their age and 8 windows more, but 15 windows at most.

    Robot 0's own: 0.8 s. Robot 1 is 6 windows old: 1.4 s. In robot 1's picture robot 0 is 12 old:
    20 windows, of which 1.5 s count.
    """
    position_m = frozen_by_hand().position_m
    np.testing.assert_allclose(position_m[0, :2], [[0.8, 0.0], [104.2, 55.6]])
    np.testing.assert_allclose(position_m[1], [[13.0, 23.0], [31.6, 41.6], [52.0, 59.0]])
    np.testing.assert_allclose(position_m[2, [0, 2]], [[1.0, 8.0], [3.0, 8.0]])


def test_spreads_grow_with_all_of_the_age_by_hand():
    """Robot 0: velocities (1, 0) and (3, 4) are sqrt(5) m/s off their mean (2, 2) each. Robot 1:
    (0, 1), (0, 1), (0, -2) off the mean (2, 1): variance 6 / 3. Robot 2's are equal.

    0.45 of sqrt(5) m/s over 0.8 and 1.4 s; of sqrt(2) m/s over 2.0, 0.8 and 1.0 s.
    """
    spread_m = frozen_by_hand().spread_m
    off_m = 0.45 * math.sqrt(5.0)
    np.testing.assert_allclose(spread_m[0, :2], [0.8 * off_m, 1.4 * off_m])
    off_m = 0.45 * math.sqrt(2.0)
    np.testing.assert_allclose(spread_m[1], [2.0 * off_m, 0.8 * off_m, 1.0 * off_m])
    np.testing.assert_array_equal(spread_m[2, [0, 2]], 0.0)


def test_pictures_rank_by_number_known_then_age_by_hand():
    """Robot 1 knows all; robots 0 and 2 two each, 3 and 2 windows old in the mean."""
    pictures = frozen_by_hand()
    assert pictures.rank.tolist() == [2, 0, 1]
    np.testing.assert_array_equal(
        pictures.is_known, [[True, True, False], [True, True, True], [True, False, True]]
    )


def test_pictures_as_good_rank_by_identity():
    timestamp = np.array([[20.0, 14.0], [14.0, 20.0]])
    nothing = np.zeros((2, 2, 2))
    frozen = freeze(nothing, nothing, timestamp, timestamp > 0.0, NOW, 0.1, 5.0)
    assert frozen.rank.tolist() == [0, 1]


def random_memory(seed, num_robots):
    """Positions, velocities, T and who is known, at t = 20."""
    rng = np.random.default_rng(seed)
    timestamp = rng.integers(1, 2 * int(NOW), (num_robots, num_robots)) / 2
    timestamp *= rng.random((num_robots, num_robots)) < 0.7
    np.fill_diagonal(timestamp, NOW)
    position_m = rng.uniform(-150.0, 150.0, (num_robots, num_robots, 2))
    velocity_mps = rng.uniform(-3.0, 3.0, (num_robots, num_robots, 2))
    return position_m, velocity_mps, timestamp, timestamp > 0.0


def frozen(memory):
    return freeze(*memory, NOW, 0.1, 15.0)


@given(seed=seeds, num_robots=st.integers(2, 8))
def test_ranks_order_the_triples(seed, num_robots):
    memory = random_memory(seed, num_robots)
    triples = []
    for i in range(num_robots):
        ages = [NOW - t for t in memory[2][i].tolist() if t > 0.0]
        triples.append((-len(ages), sum(ages) / len(ages), i))
    assert [triples[i] for i in np.argsort(frozen(memory).rank)] == sorted(triples)


@given(seed=seeds, num_robots=st.integers(2, 8))
def test_eq9_a_picture_is_its_owner_s_memory_alone(seed, num_robots):
    mine, theirs = random_memory(seed, num_robots), random_memory(seed + 1, num_robots)
    row = seed % num_robots
    mixed = [array.copy() for array in theirs]
    for array, own in zip(mixed, mine, strict=True):
        array[row] = own[row]
    for name in ("is_known", "position_m", "spread_m"):
        np.testing.assert_array_equal(
            getattr(frozen(mixed), name)[row], getattr(frozen(mine), name)[row]
        )


def test_a_picture_does_not_change_with_the_buffer():
    memory = random_memory(3, 5)
    pictures = frozen(memory)
    before = copy.deepcopy(pictures)
    for array in memory:
        array[:] = 0
    for field in fields(Pictures):
        np.testing.assert_array_equal(getattr(pictures, field.name), getattr(before, field.name))


@pytest.mark.parametrize(
    ("num_robots", "num_windows"), [(2, 10), (10, 10), (20, 10), (21, 10), (22, 11), (80, 40)]
)
def test_epochs_are_half_as_long_as_the_team_is_large(num_robots, num_windows):
    assert epoch_windows(num_robots) == num_windows


@given(seed=seeds, num_robots=st.integers(2, 8))
def test_a_plan_depends_on_one_picture_and_nothing_else(seed, num_robots):
    """Not on others' pictures, nor on where a robot that is not known is written to be."""
    team = flooded_team(paper("stationary", num_robots=num_robots), seed)
    pictures, others = (frozen(random_memory(seed + k, num_robots)) for k in (0, 1))
    whose = seed % num_robots
    mixed = copy.deepcopy(others)
    for name in ("is_known", "position_m", "spread_m"):
        getattr(mixed, name)[whose] = getattr(pictures, name)[whose]
    mixed.position_m[whose, ~mixed.is_known[whose]] += 100.0
    mixed.spread_m[whose, ~mixed.is_known[whose]] += 7.0
    plan = make_plan(team.radio, pictures, whose, team.timestamp, team.now)
    again = make_plan(team.radio, mixed, whose, team.timestamp.copy(), team.now)
    assert plan.recipient.shape == (epoch_windows(num_robots), num_robots)
    np.testing.assert_array_equal(plan.recipient, again.recipient)
    np.testing.assert_array_equal(plan.timestamp, again.timestamp)
    assert plan.is_complete == again.is_complete == all(pictures.is_known[whose].tolist())


@given(seed=seeds)
def test_a_plan_is_the_squared_greedy_schedule_of_its_picture(seed):
    team = flooded_team(paper("stationary", num_robots=6), seed)
    pictures = frozen(random_memory(seed, 6))
    is_known, position_m, spread_m = pictures.is_known, pictures.position_m, pictures.spread_m
    for whose in range(6):
        links = links_between(team.radio, position_m[whose], spread_m[whose], is_known[whose])
        recipient, after = greedy_schedule(team.timestamp, team.now, links, 10, is_squared=True)
        plan = make_plan(team.radio, pictures, whose, team.timestamp, team.now)
        np.testing.assert_array_equal(plan.recipient, recipient)
        np.testing.assert_array_equal(plan.timestamp, after)


@given(seed=seeds, num_robots=st.integers(2, 12))
def test_alg1_a_true_picture_leads_where_the_plan_says(seed, num_robots):
    """Of a standing team that everyone knows: the protocol plays the plan to the same T."""
    team = flooded_team(paper("stationary", num_robots=num_robots), seed)
    shape = (num_robots, num_robots)
    true_m = np.broadcast_to(team.position_m, (*shape, 2)).copy()
    everyone = np.ones(shape, dtype=bool)
    pictures = freeze(true_m, np.zeros((*shape, 2)), np.ones(shape), everyone, 9.0, 0.1, 15.0)
    plan = make_plan(team.radio, pictures, 0, team.timestamp, team.now)
    np.testing.assert_array_equal(plan.timestamp, after_windows(team, plan.recipient)[-1])
