import copy
import math
from dataclasses import fields

import numpy as np
import pytest
from standing_teams import view_of

from swarm_mj.mission import paper
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.planner.snapshots import (
    Proposals,
    Snapshots,
    snapshot_fields,
    take_snapshots,
)

NOW = 20.0


def believing(fresh_windows):
    """What the arithmetic here is about, whatever suits the planner best."""
    return PlannerSettings(
        fresh_rounds=0.0,
        min_fresh_windows=fresh_windows,
        steady_windows=15.0,
        std_per_distance=0.45,
        min_fresh_share=0.75,
    )


def taken_from(position_m, velocity_mps, timestamp, windows_ahead, settings):
    """Snapshots at t = 20, in windows of 0.1 s."""
    view = view_of(timestamp, position_m, velocity_mps, now=NOW)
    return take_snapshots(view, settings, window_s=0.1, windows_ahead=windows_ahead)


def taken_by_hand(fresh_windows=20.0):
    """Three robots at t = 20, snapshots for 8 windows of 0.1 s ahead.

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
    return taken_from(position_m, velocity_mps, timestamp, 8.0, believing(fresh_windows))


def test_positions_go_on_with_their_velocity_by_hand():
    """For their age and 8 windows more, but 15 windows at most.

    Robot 0's own: 0.8 s. Robot 1 is 6 windows old: 1.4 s. In robot 1's snapshot robot 0 is 12 old:
    20 windows, of which 1.5 s count.
    """
    position_m = taken_by_hand().position_m
    np.testing.assert_allclose(position_m[0, :2], [[0.8, 0.0], [104.2, 55.6]])
    np.testing.assert_allclose(position_m[1], [[13.0, 23.0], [31.6, 41.6], [52.0, 59.0]])
    np.testing.assert_allclose(position_m[2, [0, 2]], [[1.0, 8.0], [3.0, 8.0]])


def test_deviations_grow_with_all_of_the_age_by_hand():
    """Robot 0: velocities (1, 0) and (3, 4) are sqrt(5) m/s off their mean (2, 2) each. Robot 1:
    (0, 1), (0, 1), (0, -2) off the mean (2, 1): variance 6 / 3. Robot 2's are equal.

    0.45 of sqrt(5) m/s over 0.8 and 1.4 s; of sqrt(2) m/s over 2.0, 0.8 and 1.0 s.
    """
    position_std_m = taken_by_hand().position_std_m
    off_m = 0.45 * math.sqrt(5.0)
    np.testing.assert_allclose(position_std_m[0, :2], [0.8 * off_m, 1.4 * off_m])
    off_m = 0.45 * math.sqrt(2.0)
    np.testing.assert_allclose(position_std_m[1], [2.0 * off_m, 0.8 * off_m, 1.0 * off_m])
    np.testing.assert_array_equal(position_std_m[2, [0, 2]], 0.0)


def test_snapshots_rank_by_number_fresh_then_age_by_hand():
    """Robot 1 knows all; robots 0 and 2 two each, 3 and 2 windows old in the mean."""
    snapshots = taken_by_hand()
    assert snapshots.rank.tolist() == [2, 0, 1]
    np.testing.assert_array_equal(
        snapshots.is_known, [[True, True, False], [True, True, True], [True, False, True]]
    )
    np.testing.assert_array_equal(snapshots.is_fresh, snapshots.is_known)


@pytest.mark.parametrize(
    ("fresh_windows", "rank", "num_fresh"),
    [
        (12.0, [2, 0, 1], [2, 3, 2]),  # just fresh is fresh
        (11.5, [2, 0, 1], [2, 2, 2]),  # two each: 1 window old in the mean, 2 and 3
        (5.9, [2, 0, 1], [1, 2, 2]),  # robot 0 has itself alone
        (3.0, [1, 0, 2], [1, 2, 1]),  # robots 0 and 2 have themselves alone: by identity
    ],
)
def test_who_was_not_heard_of_for_long_does_not_count(fresh_windows, rank, num_fresh):
    """It stays known, and is believed to be somewhere, but neither it nor its age counts."""
    snapshots = taken_by_hand(fresh_windows)
    assert np.sum(snapshots.is_fresh, axis=1).tolist() == num_fresh
    assert snapshots.rank.tolist() == rank
    np.testing.assert_array_equal(snapshots.is_known, taken_by_hand().is_known)
    np.testing.assert_array_equal(snapshots.position_m, taken_by_hand().position_m)


def test_who_does_not_even_observe_itself_ranks_last():
    """Robot 0 was switched off at t = 5 and knows all, as of then."""
    timestamp = np.array([[5.0, 5.0, 5.0], [5.0, 20.0, 18.0], [5.0, 16.0, 20.0]])
    nothing, moving = np.zeros((3, 3, 2)), np.eye(3)[..., None] * np.ones(2)
    snapshots = taken_from(nothing, moving, timestamp, 5.0, believing(10.0))
    assert snapshots.rank.tolist() == [2, 0, 1]
    assert np.sum(snapshots.is_fresh, axis=1).tolist() == [0, 2, 2]


def test_where_nobody_moves_and_many_are_stale_all_count_as_fresh():
    """Two of three are fresh, fewer than three quarters: the team is divided, nobody is lost."""
    timestamp = np.array([[20.0, 5.0, 18.0], [5.0, 20.0, 18.0], [19.0, 16.0, 20.0]])
    nothing = np.zeros((3, 3, 2))
    snapshots = taken_from(nothing, nothing, timestamp, 5.0, believing(10.0))
    assert np.all(snapshots.is_fresh)
    assert snapshots.rank.tolist() == [1, 2, 0]  # which still counts who is


def test_a_snapshot_does_not_change_with_the_buffer():
    rng = np.random.default_rng(3)
    timestamp = np.where(np.eye(5) > 0, NOW, rng.integers(0, 40, (5, 5)) / 2)
    view = view_of(timestamp, rng.random((5, 5, 2)), rng.random((5, 5, 2)), now=NOW)
    snapshots = take_snapshots(view, believing(9.0), window_s=0.1, windows_ahead=15.0)
    before = copy.deepcopy(snapshots)
    for array in (view.timestamp, view.position_m, view.velocity_mps):
        array[:] = 0
    for field in fields(Snapshots):
        np.testing.assert_array_equal(getattr(snapshots, field.name), getattr(before, field.name))


def test_robots_adopt_the_better_of_what_they_have_and_decode():
    """Object 2 is best, then 0, 1, 3: robot 0 decodes robot 3, who holds 2, robot 1 decodes 0."""
    proposals = Proposals(rank=np.array([1, 2, 0, 3]), held=np.array([0, 1, 3, 2]))
    proposals.adopt(np.arange(4))
    assert proposals.held.tolist() == [0, 1, 3, 2]
    proposals.adopt(np.array([3, 0, 2, 1]))
    assert proposals.held.tolist() == [2, 0, 3, 2]


def test_packets_hold_two_snapshots_by_hand():
    """Of 40 robots: an owner, who is known to it, the spread of velocities, ages of all pairs, and
    ages and positions of all; `tests/protocol/test_packets.py` counts the bytes of a packet."""
    snapshot = 8 + 40 + 16 + 1600 * 16 + 40 * 16 + 40 * 2 * 16
    fields = snapshot_fields(paper("random-walk"))
    assert sum(field.num_bits for field in fields) == 2 * snapshot
