"""Plans flown on paper, held against real missions."""

from dataclasses import replace

import numpy as np
import pytest

from swarm_mj.channel import radio_of
from swarm_mj.learning.plan_practice import EXERCISES, Exercise, Team, draw_teams, mean_age
from swarm_mj.mission import paper
from swarm_mj.placement import connected_positions
from swarm_mj.policies import DecentralisedPolicy
from swarm_mj.policies.broadcasts import Foresight, Worth, schedule
from swarm_mj.policies.schedule import links_between
from swarm_mj.policies.worth import RuleOfThumb
from swarm_mj.swarm import Swarm

SMALL = paper("stationary", num_robots=8, range_ratio=0.25)
EXACT = Exercise(mission=SMALL, num_teams=2)
DOUBTED = Exercise(mission=SMALL, num_teams=3, largest_error_m=20.0)
LACKING = Exercise(mission=SMALL, num_teams=2, lacks_robot=True)


def draw(seed=0, **exercises):
    return draw_teams(exercises, np.random.default_rng(seed))


def arrays(teams):
    """All that is drawn."""
    return [
        array
        for team in teams
        for links in (team.links, *team.believed)
        for array in (links.received_mw, links.sharpness)
    ]


def test_equal_generators_draw_equal_teams():
    first, same, other = (draw(seed, a=DOUBTED, b=LACKING) for seed in (1, 1, 2))
    for drawn, again, elsewhere in zip(*map(arrays, (first, same, other)), strict=True):
        np.testing.assert_array_equal(drawn, again)
        assert not np.array_equal(drawn, elsewhere) or np.all(np.isinf(drawn))
    assert [team.exercise for team in first] == ["a", "a", "a", "b", "b"]


def test_teams_of_one_draw_differ_and_are_connected():
    one, other = draw(a=EXACT)
    assert not np.array_equal(one.links.received_mw, other.links.received_mw)
    for links in (one.links, other.links):
        is_linked = links.received_mw >= links.noise_mw * links.threshold
        assert np.all(np.linalg.matrix_power(np.eye(8) + is_linked, 8) > 0.0)


def test_without_error_everyone_believes_the_truth():
    for team in draw(a=EXACT):
        for links in team.believed:
            np.testing.assert_array_equal(links.received_mw, team.links.received_mw)
            assert np.all(np.isinf(links.sharpness))


def test_errors_are_as_large_as_they_are_said_to_be():
    """Ratios of believed to true distances, over what the sharpness says of them, are of order 1.

    Each epoch has its own errors, and each team its own size of them.
    """
    large = Exercise(mission=SMALL, num_teams=40, largest_error_m=3.0)
    deviations, sizes = [], set()
    for team in draw(a=large):
        others = ~np.eye(8, dtype=bool)
        power = team.links.received_mw[others]
        first, second, third = (links.received_mw[others] for links in team.believed)
        assert not np.array_equal(first, second)
        assert not np.array_equal(second, third)
        ratio = np.sqrt(power / first)
        deviations.append((ratio - 1.0) * team.believed[0].sharpness[others] / ratio)
        position_scale = np.sqrt(radio_of(SMALL).received_at_1_m_mw / first)
        (size,) = np.unique(np.round(position_scale / team.believed[0].sharpness[others], 6))
        sizes.add(float(size))
    assert np.std(deviations) == pytest.approx(1.0, abs=0.15)
    assert np.mean(deviations) == pytest.approx(0.0, abs=0.2)
    assert len(sizes) == 40
    assert max(sizes) <= 3.0 * np.sqrt(2.0)


def test_one_robot_is_lacking_in_all_beliefs_and_there_in_truth():
    for team in draw(a=LACKING):
        (lacking,) = np.flatnonzero(~np.any(team.believed[0].received_mw, axis=1))
        assert np.any(team.links.received_mw[lacking])
        for links in team.believed:
            expected = team.links.received_mw.copy()
            expected[lacking] = expected[:, lacking] = 0.0
            np.testing.assert_array_equal(links.received_mw, expected)


class Played(DecentralisedPolicy):
    """Speaks as it is told, and notes how old the news are."""

    transmits_twice = True

    def __init__(self, speaks):
        self.speaks = speaks
        self.ages = []

    def recipients(self, views):
        half_window = len(self.ages)
        self.ages.append(float(views.now[0] - views.buffers.timestamp[0].mean()))
        return np.where(
            self.speaks[half_window], (views.silence + 1) % views.num_robots, views.silence
        )


def flown(mission, seed, speaks):
    """The age of information in a real mission before each half window, and after the last."""
    swarm, policy = Swarm(mission, [seed]), Played(speaks)
    for _ in range(len(speaks) // 2):
        swarm.step(policy)
    return [*policy.ages, float(swarm.now[0] - swarm.buffers.timestamp[0].mean())]


def standing(mission, seed, believed=None, epoch_windows=10):
    """The team of a real mission."""
    links = links_between(radio_of(mission), Swarm(mission, [seed]).bodies.position_m[0])
    its = (links if believed is None else believed,) * 3
    return Team(exercise="x", links=links, believed=its, epoch_windows=epoch_windows)


@pytest.mark.parametrize(("seed", "num_robots"), [(1, 8), (2, 12)])
def test_eq10_where_all_is_known_a_practice_is_a_real_mission(seed, num_robots):
    """Three epochs of 10 windows are one schedule of 60 half windows; the first 20 do not count."""
    mission = paper("stationary", num_robots=num_robots)
    team = standing(mission, seed)
    speaks = np.zeros((60, num_robots), dtype=bool)
    nothing_known = np.zeros((num_robots, num_robots), dtype=np.float32)
    worth = RuleOfThumb()(team.links)
    schedule(nothing_known, 0.0, team.links, worth, Foresight(1, 1), np.ones(60, bool), speaks)
    after = flown(mission, seed, speaks)[1:]
    assert mean_age(team, RuleOfThumb()) == pytest.approx(sum(after[20:]) / 40, rel=1e-6)


class OneSpeaks:
    """Only what this robot has to tell of itself is worth anything, and robot 1's ears count."""

    parameters: dict[str, str] = {}  # noqa: RUF012

    def __call__(self, links):
        weight, nothing = np.zeros((2, *links.received_mw.shape), dtype=np.float32)
        weight[1, 0] = 1.0
        return Worth(weight, nothing, nothing, 1.05)


def two_robots():
    """100 m apart."""
    position_m = np.array([[0.0, 0.0], [100.0, 0.0]])
    return links_between(radio_of(paper("stationary", num_robots=2)), position_m)


def test_ages_of_a_team_of_two_by_hand():
    """Robot 1 always has news of robot 0, which has none of robot 1's: its age in the second and
    third epoch is that of the clock, from 10.5 to 30 windows, and one of four that count."""
    links = two_robots()
    team = Team(exercise="x", links=links, believed=(links,) * 3, epoch_windows=10)
    clock = np.arange(10.5, 30.1, 0.5)
    assert mean_age(team, OneSpeaks()) == pytest.approx(np.mean(clock) / 4, rel=1e-6)


def test_packets_travel_over_the_true_links_by_hand():
    """What is believed decodes, what is true does not: both robots know themselves only."""
    links = two_robots()
    far = links._replace(received_mw=links.received_mw / 1e6)
    team = Team(exercise="x", links=far, believed=(links,) * 3, epoch_windows=10)
    clock = np.arange(10.5, 30.1, 0.5)
    assert mean_age(team, OneSpeaks()) == pytest.approx(np.mean(clock) / 2, rel=1e-6)
    deluded = replace(team, links=links, believed=(far,) * 3)
    assert mean_age(deluded, OneSpeaks()) == pytest.approx(np.mean(clock) / 2, rel=1e-6)


@pytest.mark.parametrize(("num_robots", "epoch_windows"), [(8, 10), (20, 10), (40, 20)])
def test_epochs_are_half_a_round_but_not_too_short(num_robots, epoch_windows):
    mission = paper("stationary", num_robots=num_robots)
    (team,) = draw(a=Exercise(mission=mission, num_teams=1))
    assert team.epoch_windows == epoch_windows


def test_positions_are_drawn_first_as_a_mission_s_are():
    (team,) = draw(3, a=replace(DOUBTED, num_teams=1))
    rng = np.random.default_rng(3)
    position_m = connected_positions(8, SMALL.half_side_m, SMALL.range_m, rng)
    expected = links_between(radio_of(SMALL), position_m)
    np.testing.assert_array_equal(team.links.received_mw, expected.received_mw)


def test_the_exercises_are_of_missions_that_are_flown():
    """Sparse and dense teams, walking ones of all the paper's sizes, and one robot missing."""
    missions = [exercise.mission for exercise in EXERCISES.values()]
    assert {m.range_ratio for m in missions if m.task == "stationary"} >= {0.2, 0.25, 0.5, 0.75, 1}
    assert {m.num_robots for m in missions if m.task == "random-walk"} == {10, 20, 40, 80}
    for exercise in EXERCISES.values():
        assert (exercise.largest_error_m > 0.0) == (exercise.mission.task == "random-walk")
    assert any(exercise.lacks_robot for exercise in EXERCISES.values())
