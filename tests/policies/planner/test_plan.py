import copy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from learning_reference import planned as planned_at_once
from standing_teams import flooded_team

from swarm_mj.mission import paper
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.planner import plan
from swarm_mj.policies.planner.plan import Plan, epoch_plan, lookahead_of
from swarm_mj.policies.planner.settings import PlannerSettings, ScheduleSettings, SnapshotSettings
from swarm_mj.policies.planner.snapshots import take_snapshots
from swarm_mj.policies.planner.weights import heuristic_weights
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.window import transmit
from swarm_mj.radio.decode_curves import decode_curves
from swarm_mj.radio.links import doubtful, links_between
from swarm_mj.radio.mission_radio import Belief

seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=20)
NOW = 20.0
AGED = SnapshotSettings(fresh_rounds=0.0, min_fresh_windows=8.0)
SETTINGS = PlannerSettings()


def snapshots_of(team, seed):
    """Beliefs of robots that heard of most others, some of them long ago."""
    rng, num_robots = np.random.default_rng(seed), team.num_robots
    shape, buffers = (num_robots, num_robots), empty_buffers(1, num_robots)
    timestamp = NOW - rng.integers(0, 2 * int(NOW), shape) / 2
    timestamp *= rng.random(shape) < 0.8
    np.fill_diagonal(timestamp, NOW)
    buffers.timestamp[0] = timestamp
    buffers.position_m[0] = team.position_m + rng.normal(0.0, 20.0, (*shape, 2))
    buffers.velocity_mps[0] = rng.uniform(-3.0, 3.0, (*shape, 2))
    return take_snapshots(buffers, 0, NOW, 0.1, 15.0, AGED)


def true_snapshots(team):
    """Everyone is known, fresh, at rest, and where it is believed to be."""
    buffers = empty_buffers(1, team.num_robots)
    buffers.timestamp[...], buffers.position_m[...] = 1.0, team.position_m
    return take_snapshots(buffers, 0, 9.0, 0.1, 15.0, SnapshotSettings())


def team_of(num_robots, seed):
    return flooded_team(paper("stationary", num_robots=num_robots), seed)


def plan_of(team, snapshots, owner=0, is_free=None, settings=SETTINGS):
    free = np.ones(24, dtype=bool) if is_free is None else is_free
    return epoch_plan(
        Belief(radio=team.radio), settings, snapshots, owner, team.timestamp, team.now, free
    )


def scheduled(**numbers):
    return PlannerSettings(schedule=ScheduleSettings(**numbers))


def all_transmitters(planned, num_slots=24):
    return np.array([planned.transmits(h) for h in range(num_slots)])


@few
@given(seed=seeds, num_robots=st.integers(2, 8))
def test_a_plan_depends_on_one_snapshot_and_nothing_else(seed, num_robots):
    """Not on others' snapshots, nor on who made it, nor on where somebody unknown is written."""
    team, owner, maker = team_of(num_robots, seed), seed % num_robots, seed // 8 % num_robots
    mine, mixed = snapshots_of(team, seed), copy.deepcopy(snapshots_of(team, seed + 1))
    for name in ("is_known", "is_fresh", "position_m", "position_std_m", "timestamp"):
        getattr(mixed, name)[maker] = getattr(mine, name)[owner]
    mixed.position_m[maker, ~mixed.is_known[maker]] += 100.0
    mixed.position_std_m[maker, ~mixed.is_known[maker]] += 7.0
    planned, again = plan_of(team, mine, owner), plan_of(team, mixed, maker)
    np.testing.assert_array_equal(all_transmitters(planned), all_transmitters(again))
    np.testing.assert_array_equal(planned.outcome(), again.outcome())


@few
@given(seed=seeds, chunk=st.integers(1, 30))
def test_a_plan_worked_out_bit_by_bit_is_the_plan_worked_out_at_once(seed, chunk):
    """Looking ahead does not end where the slots asked for do."""
    team = team_of(8, seed)
    snapshots, is_free = snapshots_of(team, seed), np.random.default_rng(seed).random(24) < 0.8
    lazily, at_once = (
        plan_of(team, snapshots, is_free=is_free, settings=scheduled(chunk_slots=slots))
        for slots in (chunk, 1000)
    )
    transmits = all_transmitters(lazily)
    outcome = at_once.outcome()
    np.testing.assert_array_equal(transmits, all_transmitters(at_once))
    np.testing.assert_array_equal(lazily.outcome(), outcome)
    np.testing.assert_array_equal(transmits, all_transmitters(lazily))


@few
@given(seed=seeds)
def test_slots_that_are_not_free_stay_silent(seed):
    team = team_of(8, seed)
    is_free = np.random.default_rng(seed).random(24) < 0.5
    transmits = all_transmitters(plan_of(team, true_snapshots(team), is_free=is_free))
    assert not np.any(transmits[~is_free])
    assert np.all(np.any(transmits[is_free], axis=1))  # at rest there is always something to tell


def test_while_nobody_may_speak_all_learn_the_time_alone():
    team = team_of(8, 1)
    known = plan_of(team, true_snapshots(team), is_free=np.zeros(24, dtype=bool)).outcome()
    expected = team.timestamp.copy()
    np.fill_diagonal(expected, team.now + 12.0)
    np.testing.assert_array_equal(known, expected)


@few
@given(seed=seeds, num_robots=st.integers(2, 10))
def test_alg1_a_true_snapshot_leads_where_the_plan_says(seed, num_robots):
    """Of a standing team that everyone knows: the protocol plays the plan to the same T."""
    team = team_of(num_robots, seed)
    planned = plan_of(team, true_snapshots(team))
    buffers, now = empty_buffers(1, num_robots), np.array([team.now])
    buffers.timestamp[0] = team.timestamp
    states = RobotStates(
        position_m=team.position_m[None], velocity_mps=np.zeros((1, num_robots, 2))
    )
    robots = np.arange(num_robots)
    for transmits in all_transmitters(planned):
        now = now + 0.5
        recipient = np.where(transmits, (robots + 1) % num_robots, robots)
        transmit(buffers, states, recipient[None], team.radio, now)
    np.testing.assert_array_equal(planned.outcome(), buffers.timestamp[0])


@given(seed=seeds, num_robots=st.integers(2, 8))
def test_what_was_expected_of_the_lost_is_corrected(seed, num_robots):
    """Of who is not fresh nothing newer is known to anybody than the snapshot has of it, and to it
    nothing newer; what is expected of the others stays."""
    team, owner = team_of(num_robots, seed), seed % num_robots
    snapshots = snapshots_of(team, seed)
    expected = np.random.default_rng(seed).integers(0, 40, (num_robots, num_robots)) / 2
    planned = epoch_plan(
        Belief(radio=team.radio), SETTINGS, snapshots, owner, expected, NOW, np.ones(0, dtype=bool)
    )
    heard, is_fresh = snapshots.timestamp[owner], snapshots.is_fresh[owner]
    for i in range(num_robots):
        for k in range(num_robots):
            bounds = [heard[robot] for robot in {i, k} if not is_fresh[robot]]
            assert planned.outcome()[i, k] == min([expected[i, k], *bounds])


def test_a_plan_is_the_schedule_of_its_snapshot_s_links(monkeypatch):
    """Weights are asked of the links that the snapshot has, once."""
    team = team_of(8, 5)
    snapshots, asked = snapshots_of(team, 5), []

    def noting(links, settings):
        asked.append((links, settings))
        return heuristic_weights(links, settings)

    monkeypatch.setattr(plan, "heuristic_weights", noting)
    plan_of(team, snapshots, 3).outcome()
    believed = (snapshots.position_m[3], snapshots.position_std_m[3], snapshots.is_known[3])
    ((links, settings),) = asked
    for mine, expected in zip(links, links_between(team.radio, *believed), strict=True):
        np.testing.assert_array_equal(mine, expected)
    assert settings == SETTINGS.weights


def test_large_teams_look_less_far_ahead():
    """Whose plans would take long otherwise."""
    numbers = ScheduleSettings(
        rest_width=6, rest_depth=5, moving_width=4, moving_depth=3, max_lookahead_robots=50
    )
    for num_robots, at_rest, moving in [
        (2, (6, 5), (4, 3)),
        (50, (6, 5), (4, 3)),
        (51, (1, 1), (1, 1)),
        (1000, (1, 1), (1, 1)),
    ]:
        assert lookahead_of(num_robots, is_certain=True, settings=numbers) == at_rest
        assert lookahead_of(num_robots, is_certain=False, settings=numbers) == moving


def test_who_was_not_heard_of_for_three_rounds_is_planned_without():
    """A plan of a snapshot in which a robot was silent for so long has no links to it."""
    team = team_of(6, 1)
    snapshots = true_snapshots(team)
    now = SETTINGS.schedule.gone_rounds * SETTINGS.schedule.min_round_windows + 2.0
    snapshots.timestamp[:] = now - 1.0
    team = replace(team, now=now)
    whole = plan_of(team, snapshots)
    assert all_transmitters(whole)[:, 2].any()
    snapshots.timestamp[0, 2], snapshots.is_fresh[0, 2] = 1.0, False
    without = plan_of(team, snapshots)
    assert not all_transmitters(without)[:, 2].any()


def test_a_plan_ends_with_its_epoch():
    team = team_of(4, 1)
    planned = plan_of(team, true_snapshots(team))
    with pytest.raises(IndexError):
        planned.transmits(24)


@pytest.mark.parametrize("is_doubtful", [False, True])
@pytest.mark.parametrize("chunk_slots", [1, 7, 10])
def test_chunks_of_an_endless_plan_make_one_plan(chunk_slots, is_doubtful):
    links = links_between(team_of(8, 2).radio, team_of(8, 2).position_m)
    if is_doubtful:
        links = doubtful(links, decode_curves(), np.full((8, 8), 2.0))
    endless = Plan(links, scheduled(chunk_slots=chunk_slots))
    last = endless.transmits(29).copy()
    made = all_transmitters(endless, 30)
    np.testing.assert_array_equal(made, planned_at_once(links, SETTINGS, 30))
    np.testing.assert_array_equal(made[29], last)  # slots may be asked for in any order
    assert np.all(np.any(made, axis=0))  # everyone has its say
