"""The record of a flight against the swarm it was taken from."""

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.replay import palette, recorder, replay_size
from swarm_mj.replay.links import radio_snapshot
from swarm_mj.replay.recorder import Recorder, moment
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm


def flown(look, *, policy=("mst", 0.4), task="random-walk", ego=2, **settings):
    """A short flight's recorder, and how the swarm looked after each window."""
    mission = paper(task, **{"num_robots": 8, "num_windows": 12} | settings)
    swarm = Swarm(mission, [3])
    record, seen = Recorder(swarm, ego=ego), []
    for window in rollout(swarm, make_policy(policy[0], mission, *policy[1:])):
        record.add(window)
        seen.append(look(swarm))
    return record, seen


def ages(swarm):
    return swarm.now[0] - swarm.buffers.timestamp[0]


def test_statistics_are_of_the_robots_that_are_on():
    def look(swarm):
        active, age = swarm.states.is_active, ages(swarm)
        on = [i for i in range(7) if active is None or active[0, i]]
        return [age[i, j] for i in on for j in on if i != j]

    record, seen = flown(look, num_robots=7, num_windows=9, failure_fraction=0.3)
    log = record.log()
    assert np.sum(log.is_on, axis=1).tolist() == [7] * 4 + [5] * 5
    np.testing.assert_array_equal(log.is_on[-1], record._swarm.states.is_active[0])
    np.testing.assert_allclose(log.age_std, [np.std(its) for its in seen])
    np.testing.assert_allclose(log.age_max, [np.max(its) for its in seen])


def test_a_log_is_the_swarm_s_state_field_by_field():
    def look(swarm):
        states, buffers, age = swarm.states, swarm.buffers, ages(swarm)
        is_known = buffers.timestamp[0, 3] > 0
        return {
            "position_m": states.position_m[0].copy(),
            "velocity_mps": states.velocity_mps[0].copy(),
            "velocity_variance_m2ps2": states.velocity_mps[0].var(axis=0).sum(),
            "believed_m": buffers.position_m[0, 3].copy(),
            "parent": buffers.parent[0, 3].copy(),
            "age": age,
            "age_mean": age.mean(),
            "ego_age": age[3],  # of robots never heard of, the mission's
            "known_age": [
                own if known else np.nan for own, known in zip(age[3], is_known, strict=True)
            ],
            "is_other_known": is_known & (np.arange(6) != 3),
            "heard": [phase.heard[0].copy() for phase in swarm.phases],
        }

    record, seen = flown(look, task="flocking", ego=3, num_robots=6, num_windows=8)
    log = record.log()
    np.testing.assert_array_equal(log.window, np.arange(1, 9))
    assert not np.all(seen[0]["is_other_known"])
    for field in seen[0]:
        expected = [row[field] for row in seen]
        np.testing.assert_allclose(getattr(log, field), expected, rtol=1e-9, err_msg=field)


def test_snapshots_are_taken_every_few_windows_and_groups_stand_until_the_next():
    city = {"num_robots": 10, "arena": "blocks", "shadowing_db": 6.0}
    record, seen = flown(radio_snapshot, policy=("tdma",), **city)
    log = record.log()
    np.testing.assert_array_equal(log.mismatch.window, [1, 6, 11])
    groups = [seen[5 * (w // 5)].group for w in range(12)]
    for window in (1, 6, 11):
        shown, expected = log.mismatch.at(window), seen[window - 1].links
        expected["row"] = window // 5
        np.testing.assert_array_equal(shown, expected)
    is_apart = np.array([[of != team[2] for of in team] for team in groups])
    np.testing.assert_array_equal(log.is_cut_off, is_apart)
    kept = [log.age, *(getattr(log, name) for name in recorder._Rows._fields)]
    found = sum(seen[w].links.nbytes + seen[w].group.nbytes for w in (0, 5, 10))
    assert record.num_bytes == sum(each.nbytes for each in kept) + found


def test_free_space_has_no_snapshots():
    record, _ = flown(ages)
    log = record.log()
    assert not log.is_compared
    assert not np.any(log.is_cut_off)


@pytest.mark.parametrize(
    ("stride_bytes", "own"),
    [(64e6, {}), (5 * 8 * 8 * 4.0, {}), (64e6, {"robot": "quadrotor", "wind_mps": 2.0})],
)
def test_a_record_that_outgrows_its_room_is_the_same(monkeypatch, stride_bytes, own):
    """Room for one window, then two, four and so on, with every age matrix and every third."""
    monkeypatch.setattr(recorder, "MAX_AGE_MATRIX_BYTES", stride_bytes)
    swarm = Swarm(paper("random-walk", num_robots=8, num_windows=12, **own), [3])
    ample, tight = Recorder(swarm), Recorder(swarm, first_room=1)
    for window in rollout(swarm, make_policy("mst", swarm.mission, 0.4)):
        ample.add(window)
        tight.add(window)
    expected, found = ample.log(), tight.log()
    assert (found.wind_mps is not None) == ("robot" in own)
    fields = [*recorder._Rows._fields, "age", "age_window"]
    if own:
        fields += recorder._BodyRows._fields
    for name in fields:
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), name)


def test_large_flights_keep_every_kth_age_matrix(monkeypatch):
    # Twelve matrices of 8 x 8 float32 in room for five: every third one is kept.
    monkeypatch.setattr(recorder, "MAX_AGE_MATRIX_BYTES", 5 * 8 * 8 * 4.0)
    record, seen = flown(ages)
    log = record.log()
    np.testing.assert_array_equal(log.age_window, [1, 4, 7, 10])
    np.testing.assert_array_equal(log.age, [seen[w - 1] for w in (1, 4, 7, 10)])


def test_of_a_large_team_the_matrix_has_every_kth_robot(monkeypatch):
    monkeypatch.setattr(replay_size, "MAX_MATRIX_ROBOTS", 4)
    swarm = Swarm(paper("random-walk", num_robots=9, num_windows=6), [0])
    record, seen = Recorder(swarm), []
    for window in rollout(swarm, make_policy("round-robin", swarm.mission)):
        record.add(window)
        seen.append(swarm.now[0] - swarm.buffers.timestamp[0])
    log, some = record.log(), [0, 3, 6]
    np.testing.assert_array_equal(log.age, [age[np.ix_(some, some)] for age in seen])
    off = ~np.eye(9, dtype=bool)
    np.testing.assert_allclose(log.age_std, [np.std(age[off]) for age in seen])
    np.testing.assert_array_equal(log.age_max, [np.max(age[off]) for age in seen])


def test_an_interrupt_inside_add_leaves_a_whole_log(monkeypatch):
    mission = paper("stationary", num_robots=5, num_windows=4)
    swarm = Swarm(mission, [0])
    record = Recorder(swarm)
    windows = rollout(swarm, make_policy("round-robin", mission))
    record.add(next(windows))

    def interrupt(*_):
        raise KeyboardInterrupt

    second = next(windows)
    monkeypatch.setattr(recorder, "_age_spread", interrupt)
    with pytest.raises(KeyboardInterrupt):
        record.add(second)
    monkeypatch.undo()
    log = record.log()
    assert len(log.window) == len(log.age_window) == len(log.age) == len(log.position_m) == 1


def test_an_ego_robot_must_exist_and_nothing_flown_is_no_log():
    swarm = Swarm(paper("stationary", num_robots=8), [0])
    for ego in (-1, 8):
        with pytest.raises(ValueError, match=f"observer must be from 0 to 7, not {ego}"):
            Recorder(swarm, ego=ego)
    with pytest.raises(ValueError, match="at least 1 window"):
        Recorder(swarm).log()


@pytest.fixture
def swarm():
    return Swarm(paper("flocking", num_robots=8, num_windows=20, failure_fraction=0.25), [3, 4])


def test_before_the_first_window_everyone_is_grey_but_the_white_observer(swarm):
    seen = moment(swarm, 1, observer=2)
    np.testing.assert_array_equal(seen.position_m[0], swarm.states.position_m[1])
    np.testing.assert_array_equal(seen.velocity_mps[0], swarm.states.velocity_mps[1])
    expected = np.tile(np.array(palette.UNKNOWN), (8, 1))
    expected[2] = palette.EGO
    np.testing.assert_array_equal(seen.colours[0], expected)
    assert all(len(packets.row) == 0 for packets in seen.packets.values())


def test_a_live_picture_has_the_packets_of_the_last_window_of_its_mission(swarm):
    policy = make_policy("random-flooding", swarm.mission, 0.3)
    for _ in range(4):
        swarm.step(policy)
    packets = moment(swarm, 1).packets_at(0)["heard"]
    where = swarm.states.position_m[1]
    expected = [
        (*where[phase.heard[1, j]], *where[j])
        for phase in swarm.phases
        for j in range(8)
        if phase.heard[1, j] != j
    ]
    assert len(expected) > 0
    np.testing.assert_allclose(np.hstack(packets[1:]), expected)


def test_a_live_picture_shows_links_that_surprise_and_who_is_cut_off():
    mission = paper("random-walk", num_robots=10, arena="blocks", shadowing_db=6.0)
    city = Swarm(mission, [3, 4])
    for _ in range(60):
        city.move()
    seen, shown = radio_snapshot(city, 1), moment(city, 1, observer=2)
    own = seen.links[(seen.links["sender"] == 2) | (seen.links["receiver"] == 2)]
    num_weak = np.sum(own["is_too_weak"])
    assert num_weak > 0
    assert len(shown.mismatch_lines(0)[0]) == 4 * num_weak + len(own) - num_weak
    np.testing.assert_array_equal(shown.is_cut_off[0], seen.group != seen.group[2])


def test_robots_that_failed_are_dark(swarm):
    policy = make_policy("tdma", swarm.mission)
    for _ in range(12):
        swarm.step(policy)
    is_off = ~swarm.states.is_active[0]
    assert np.sum(is_off) == 2
    is_dark = np.all(moment(swarm).colours[0] == palette.SWITCHED_OFF, axis=1)
    np.testing.assert_array_equal(is_dark, is_off)


def test_what_is_not_there_is_refused(swarm):
    with pytest.raises(ValueError, match="observer must be from 0 to 7, not 8"):
        moment(swarm, observer=8)
    with pytest.raises(IndexError):
        moment(swarm, 2)
