import copy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from standing_teams import flooded_team

from swarm_mj.mission import paper
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.planner import plan
from swarm_mj.policies.planner.plan import Plan, foresight_of
from swarm_mj.policies.planner.snapshots import Pictures, freeze
from swarm_mj.policies.planner.weights import RuleOfThumb
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.window import transmit
from swarm_mj.radio.links import links_between

seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=20)
NOW, AGED = 20.0, 8.0


def pictures_of(team, seed, *, age=NOW):
    """What robots may believe that heard of most others, some of them long ago."""
    rng, num_robots = np.random.default_rng(seed), team.num_robots
    shape = (num_robots, num_robots)
    timestamp = NOW - rng.integers(0, 2 * int(age), shape) / 2
    timestamp *= rng.random(shape) < 0.8
    np.fill_diagonal(timestamp, NOW)
    position_m = team.position_m + rng.normal(0.0, 20.0, (*shape, 2))
    velocity_mps = rng.uniform(-3.0, 3.0, (*shape, 2))
    return freeze(position_m, velocity_mps, timestamp, timestamp > 0.0, NOW, 0.1, 15.0, AGED)


def true_pictures(team):
    """Everyone is known, fresh, and where it is believed to be."""
    shape = (team.num_robots, team.num_robots)
    true_m = np.broadcast_to(team.position_m, (*shape, 2)).copy()
    everyone = np.ones(shape, dtype=bool)
    return freeze(true_m, np.zeros((*shape, 2)), np.ones(shape), everyone, 9.0, 0.1, 15.0, 20.0)


def team_of(num_robots, seed):
    return flooded_team(paper("stationary", num_robots=num_robots), seed)


def plan_of(team, pictures, whose=0, is_free=None):
    free = np.ones(24, dtype=bool) if is_free is None else is_free
    return Plan(team.radio, RuleOfThumb(), pictures, whose, team.timestamp, team.now, free)


def all_speakers(planned, num_half_windows=24):
    return np.array([planned.speaks(h) for h in range(num_half_windows)])


@few
@given(seed=seeds, num_robots=st.integers(2, 8))
def test_a_plan_depends_on_one_picture_and_nothing_else(seed, num_robots):
    """Not on others' pictures, nor on who made it, nor on where somebody unknown is written."""
    team, whose, maker = team_of(num_robots, seed), seed % num_robots, seed // 8 % num_robots
    mine, mixed = pictures_of(team, seed), copy.deepcopy(pictures_of(team, seed + 1))
    for name in ("is_known", "is_fresh", "position_m", "spread_m", "timestamp"):
        getattr(mixed, name)[maker] = getattr(mine, name)[whose]
    mixed.position_m[maker, ~mixed.is_known[maker]] += 100.0
    mixed.spread_m[maker, ~mixed.is_known[maker]] += 7.0
    planned, again = plan_of(team, mine, whose), plan_of(team, mixed, maker)
    np.testing.assert_array_equal(all_speakers(planned), all_speakers(again))
    np.testing.assert_array_equal(planned.outcome(), again.outcome())
    assert planned.is_complete == again.is_complete == all(mine.is_known[whose].tolist())
    np.testing.assert_array_equal(planned.is_fresh, mine.is_fresh[whose])


def test_another_picture_is_another_plan():
    team = team_of(8, 3)
    plans = [all_speakers(plan_of(team, pictures_of(team, 3), whose)) for whose in (0, 1)]
    assert np.any(plans[0] != plans[1])


@few
@given(seed=seeds, chunk=st.integers(1, 30))
def test_a_plan_worked_out_bit_by_bit_is_the_plan_worked_out_at_once(seed, chunk):
    """Looking ahead does not end where the half windows asked for do."""
    team = team_of(8, seed)
    pictures, is_free = pictures_of(team, seed), np.random.default_rng(seed).random(24) < 0.8
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(plan, "CHUNK", chunk)
        lazily = plan_of(team, pictures, is_free=is_free)
        speaks = all_speakers(lazily)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(plan, "CHUNK", 1000)
        at_once = plan_of(team, pictures, is_free=is_free)
        outcome = at_once.outcome()
    np.testing.assert_array_equal(speaks, all_speakers(at_once))
    np.testing.assert_array_equal(lazily.outcome(), outcome)
    np.testing.assert_array_equal(speaks, all_speakers(lazily))


@few
@given(seed=seeds)
def test_half_windows_that_are_not_free_stay_silent(seed):
    team = team_of(8, seed)
    is_free = np.random.default_rng(seed).random(24) < 0.5
    speaks = all_speakers(plan_of(team, true_pictures(team), is_free=is_free))
    assert not np.any(speaks[~is_free])
    assert np.all(np.any(speaks[is_free], axis=1))  # at rest there is always something to tell


def test_while_nobody_may_speak_all_learn_the_time_alone():
    team = team_of(8, 1)
    known = plan_of(team, true_pictures(team), is_free=np.zeros(24, dtype=bool)).outcome()
    expected = team.timestamp.copy()
    np.fill_diagonal(expected, team.now + 12.0)
    np.testing.assert_array_equal(known, expected)


@few
@given(seed=seeds, num_robots=st.integers(2, 10))
def test_alg1_a_true_picture_leads_where_the_plan_says(seed, num_robots):
    """Of a standing team that everyone knows: the protocol plays the plan to the same T."""
    team = team_of(num_robots, seed)
    planned = plan_of(team, true_pictures(team))
    buffers, now = empty_buffers(1, num_robots), np.array([team.now])
    buffers.timestamp[0] = team.timestamp
    bodies = RobotStates(
        position_m=team.position_m[None], velocity_mps=np.zeros((1, num_robots, 2))
    )
    robots = np.arange(num_robots)
    for speaks in all_speakers(planned):
        now = now + 0.5
        recipient = np.where(speaks, (robots + 1) % num_robots, robots)
        transmit(buffers, bodies, recipient[None], team.radio, now)
    np.testing.assert_array_equal(planned.outcome(), buffers.timestamp[0])
    assert planned.is_complete


@given(seed=seeds, num_robots=st.integers(2, 8))
def test_what_was_expected_of_the_lost_is_corrected(seed, num_robots):
    """Of who is not fresh nothing newer is known to anybody than the picture has of it, and to it
    nothing newer; what is expected of the others stays."""
    team, whose = team_of(num_robots, seed), seed % num_robots
    pictures = pictures_of(team, seed)
    expected = np.random.default_rng(seed).integers(0, 40, (num_robots, num_robots)) / 2
    planned = Plan(
        team.radio, RuleOfThumb(), pictures, whose, expected, NOW, np.ones(0, dtype=bool)
    )
    heard, is_fresh = pictures.timestamp[whose], pictures.is_fresh[whose]
    for i in range(num_robots):
        for k in range(num_robots):
            bounds = [heard[robot] for robot in {i, k} if not is_fresh[robot]]
            assert planned.outcome()[i, k] == min([expected[i, k], *bounds])


def test_a_plan_is_the_schedule_of_its_picture_s_links():
    """Worth is asked of the links that the picture has, once."""
    team = team_of(8, 5)
    pictures, asked = pictures_of(team, 5), []

    class Asked(RuleOfThumb):
        def __call__(self, links):
            asked.append(links)
            return super().__call__(links)

    free = np.ones(24, dtype=bool)
    planned = Plan(team.radio, Asked(), pictures, 3, team.timestamp, team.now, free)
    planned.outcome()
    believed = (pictures.position_m[3], pictures.spread_m[3], pictures.is_known[3])
    (links,) = asked
    for mine, expected in zip(links, links_between(team.radio, *believed), strict=True):
        np.testing.assert_array_equal(mine, expected)


def test_a_plan_does_not_change_what_it_is_made_of():
    team = team_of(8, 2)
    pictures = pictures_of(team, 2)
    before = copy.deepcopy((team.timestamp, vars(pictures)))
    plan_of(team, pictures, 4).outcome()
    np.testing.assert_array_equal(team.timestamp, before[0])
    for name, array in before[1].items():
        np.testing.assert_array_equal(getattr(pictures, name), array)
    assert isinstance(pictures, Pictures)


def test_large_teams_look_less_far_ahead():
    """Whose plans would take long otherwise."""
    sizes = [2, plan.LARGEST_FAR, plan.LARGEST_FAR + 1, 1000]
    foresights = [foresight_of(num_robots, is_certain=False) for num_robots in sizes]
    assert foresights[:2] == [plan.FAR, plan.FAR]
    assert foresights[2:] == [plan.NO_FORESIGHT] * 2 == [(1, 1)] * 2
    certain = [foresight_of(num_robots, is_certain=True) for num_robots in sizes]
    assert certain == [plan.FARTHER] * 2 + [plan.NO_FORESIGHT] * 2
    costs = [branches * half_windows for branches, half_windows in foresights]
    assert costs == sorted(costs, reverse=True)
    assert costs[0] > 1


def test_looking_ahead_is_by_team_size(monkeypatch):
    """Of the same picture, the plan of a team too large to look ahead is another one."""
    team = team_of(12, 1)
    far = all_speakers(plan_of(team, true_pictures(team)))
    monkeypatch.setattr(plan, "LARGEST_FAR", 11)
    monkeypatch.setattr(plan, "LARGEST_NEAR", 11, raising=False)
    near = all_speakers(plan_of(team, true_pictures(team)))
    assert np.any(far != near)


def test_who_was_not_heard_of_for_three_rounds_is_planned_without():
    """A plan of a picture in which a robot was silent for so long has no links to it."""
    team = team_of(6, 1)
    pictures = true_pictures(team)
    now = plan.GONE * plan.SHORTEST_ROUND + 2.0
    pictures.timestamp[:] = now - 1.0
    free = np.ones(24, dtype=bool)
    whole = Plan(team.radio, RuleOfThumb(), pictures, 0, team.timestamp, now, free)
    assert all_speakers(whole)[:, 2].any()
    pictures.timestamp[0, 2], pictures.is_fresh[0, 2] = 1.0, False
    without = Plan(team.radio, RuleOfThumb(), pictures, 0, team.timestamp, now, free)
    assert not all_speakers(without)[:, 2].any()


def test_a_plan_ends_with_its_epoch():
    team = team_of(4, 1)
    planned = plan_of(team, true_pictures(team))
    with pytest.raises(IndexError, match="24 half windows, not 24"):
        planned.speaks(24)
