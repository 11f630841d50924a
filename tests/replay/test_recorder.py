"""The record of a flight against the swarm it was taken from."""

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.replay import recorder
from swarm_mj.replay.mismatch import radio_snapshot
from swarm_mj.replay.recorder import Recorder
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm


def flown_log(num_windows=12, ego=2, num_robots=8):
    """A short flight's log, and what the test itself saw of every window."""
    mission = paper("random-walk", num_robots=num_robots, num_windows=num_windows)
    swarm = Swarm(mission, [3])
    policy = make_policy("mst", mission, 0.4)
    record = Recorder(swarm, ego=ego)
    seen = []
    for window in rollout(swarm, policy):
        record.add(window)
        seen.append((swarm.states.position_m[0].copy(), swarm.now[0] - swarm.buffers.timestamp[0]))
    return record.log(), seen


def test_a_log_holds_the_true_positions_of_every_window():
    log, seen = flown_log()
    np.testing.assert_array_equal(log.position_m, [position for position, _ in seen])
    np.testing.assert_array_equal(log.window, np.arange(1, 13))


def test_ages_are_those_of_the_buffers():
    log, seen = flown_log()
    ages = np.array([age for _, age in seen])
    np.testing.assert_array_equal(log.age, ages)
    np.testing.assert_array_equal(log.ego_age, ages[:, 2])
    np.testing.assert_allclose(log.age_mean, ages.mean(axis=(1, 2)), rtol=1e-12)
    others = ages[:, ~np.eye(8, dtype=bool)]
    np.testing.assert_allclose(log.age_std, others.std(axis=1), rtol=1e-12)
    np.testing.assert_array_equal(log.age_max, others.max(axis=1))


def test_statistics_are_of_the_robots_that_are_on():
    mission = paper("random-walk", num_robots=7, num_windows=9, failure_fraction=0.3)
    swarm = Swarm(mission, [3])
    record = Recorder(swarm)
    ages = []
    for window in rollout(swarm, make_policy("mst", mission, 0.4)):
        record.add(window)
        on = [i for i in range(7) if swarm.states.is_active is None or swarm.states.is_active[0, i]]
        timestamp = swarm.buffers.timestamp[0]
        ages.append([swarm.now[0] - timestamp[i, j] for i in on for j in on if i != j])
    log = record.log()
    assert np.sum(log.is_on, axis=1).tolist() == [7] * 4 + [5] * 5
    np.testing.assert_array_equal(log.is_on[-1], swarm.states.is_active[0])
    np.testing.assert_allclose(log.age_std, [np.std(its) for its in ages])
    np.testing.assert_allclose(log.age_max, [np.max(its) for its in ages])


def test_a_log_is_the_swarm_s_state_field_by_field():
    mission = paper("flocking", num_robots=6, num_windows=8)
    swarm = Swarm(mission, [2])
    record = Recorder(swarm, ego=3)
    seen = {"velocity_mps": [], "believed_m": [], "parent": [], "is_known": [], "heard": []}
    variance = []
    for window in rollout(swarm, make_policy("mst", mission, 0.5)):
        record.add(window)
        seen["velocity_mps"].append(swarm.states.velocity_mps[0].copy())
        seen["believed_m"].append(swarm.buffers.position_m[0, 3].copy())
        seen["parent"].append(swarm.buffers.parent[0, 3].copy())
        seen["is_known"].append(swarm.buffers.timestamp[0, 3] > 0)
        seen["heard"].append([swarm.phases[0].heard[0], swarm.phases[1].heard[0]])
        variance.append(swarm.states.velocity_mps[0].var(axis=0).sum())
    log = record.log()
    for field, rows in seen.items():
        np.testing.assert_array_equal(getattr(log, field), rows, err_msg=field)
    np.testing.assert_allclose(log.velocity_variance_m2ps2, variance, rtol=1e-9)


def test_looks_are_taken_every_few_windows_and_groups_stand_until_the_next():
    mission = paper("random-walk", num_robots=10, num_windows=12, arena="blocks", shadowing_db=6.0)
    swarm = Swarm(mission, [3])
    record, seen = Recorder(swarm, ego=2), []
    for window in rollout(swarm, make_policy("tdma", mission)):
        record.add(window)
        seen.append(radio_snapshot(swarm))
    log = record.log()
    np.testing.assert_array_equal(log.mismatch.window, [1, 6, 11])
    np.testing.assert_array_equal(log.group, [seen[5 * (w // 5)].group for w in range(12)])
    for window in (1, 6, 11):
        shown, expected = log.mismatch.at(window), seen[window - 1].mismatch
        np.testing.assert_array_equal(shown.sender, expected.sender)
        np.testing.assert_array_equal(shown.margin_db, expected.margin_db)
    is_apart = np.array([[of != team[2] for of in team] for team in log.group])
    np.testing.assert_array_equal(log.is_cut_off, is_apart)
    kept = [*record._age, *(value for row in record._rows for value in row.values())]
    found = sum(array.nbytes for w in (0, 5, 10) for array in vars(seen[w].mismatch).values())
    assert record.num_bytes == sum(each.nbytes for each in kept) + found


def test_free_space_is_not_looked_at():
    log, _ = flown_log()
    assert log.mismatch is None
    assert log.group is None
    assert not np.any(log.is_cut_off)


def test_what_is_kept_does_not_keep_what_is_not():
    """A row that is a view would hold its whole matrix in memory."""
    swarm = Swarm(paper("stationary", num_robots=6), [0])
    record = Recorder(swarm)
    record.add(next(rollout(swarm, make_policy("round-robin", swarm.mission))))
    for name, kept in record._rows[0].items():
        assert not isinstance(kept, np.ndarray) or kept.base is None, name


def test_an_unknown_robot_is_as_old_as_the_mission():
    log, _ = flown_log()
    first = log.ego_age[0]
    assert set(first[~log.is_known[0]]) == {1.0}
    assert first[2] == 0.0


def test_large_flights_keep_every_kth_age_matrix(monkeypatch):
    # Twelve matrices of 8 x 8 float32 in room for five: every third one is kept.
    monkeypatch.setattr(recorder, "MAX_AGE_MATRIX_BYTES", 5 * 8 * 8 * 4.0)
    log, seen = flown_log()
    np.testing.assert_array_equal(log.age_window, [1, 4, 7, 10])
    np.testing.assert_array_equal(log.age, [seen[w - 1][1] for w in (1, 4, 7, 10)])


def test_an_interrupt_inside_add_leaves_a_whole_log(monkeypatch):
    mission = paper("stationary", num_robots=5, num_windows=4)
    swarm = Swarm(mission, [0])
    record = Recorder(swarm)
    windows = rollout(swarm, make_policy("round-robin", mission))
    record.add(next(windows))

    def interrupt(*_):
        raise KeyboardInterrupt

    second = next(windows)
    monkeypatch.setattr(recorder.np, "std", interrupt)
    with pytest.raises(KeyboardInterrupt):
        record.add(second)
    monkeypatch.undo()
    log = record.log()
    assert len(log.window) == len(log.age_window) == len(log.age) == len(log.position_m) == 1


@pytest.mark.parametrize("ego", [-1, 8])
def test_an_ego_robot_must_exist(ego):
    swarm = Swarm(paper("stationary", num_robots=8), [0])
    with pytest.raises(ValueError, match=f"observer must be from 0 to 7, not {ego}"):
        Recorder(swarm, ego=ego)


def test_nothing_flown_is_no_log():
    with pytest.raises(ValueError, match="at least 1 window"):
        Recorder(Swarm(paper("stationary", num_robots=4), [0])).log()
