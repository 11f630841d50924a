import numpy as np
import pytest
from standing_teams import flooded_team

from swarm_mj.mission import paper
from swarm_mj.physics.state import BOX, Obstacles, RobotStates
from swarm_mj.policies.lookahead_oracle import LOOKAHEAD, WEIGHED_SLOTS
from swarm_mj.policies.planner.plan import Plan
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.policy import two_broadcasts
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.buffers import BROADCAST, empty_buffers
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.links import among, links_between
from swarm_mj.radio.mission_radio import TrueLinks, mission_radio, radio_of
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm

SETTINGS = PlannerSettings(rest_lookahead=LOOKAHEAD, max_lookahead_robots=100)


def ages(name, mission, seeds):
    """Each mission's age of information."""
    return summarise(rollout(Swarm(mission, seeds), make_policy(name, mission))).aoi_mean


def started(mission, num_missions=1):
    policy = make_policy("lookahead-oracle", mission)
    policy.start(mission.num_robots, [np.random.default_rng(b) for b in range(num_missions)])
    return policy


def views_of(timestamp, now):
    buffers = empty_buffers(1, len(timestamp))
    buffers.timestamp[0] = timestamp
    return LocalViews(buffers=buffers, now=np.array([now]), phases=())


def states_of(position_m, is_active=None):
    return RobotStates(
        position_m=position_m[None],
        velocity_mps=np.zeros((1, len(position_m), 2)),
        is_active=None if is_active is None else is_active[None],
    )


def speakers(policy, timestamp, now, position_m, is_active=None):
    """Who broadcasts in the slot that begins now; all others are silent."""
    (recipient,) = policy.recipients(views_of(timestamp, now), states_of(position_m, is_active))
    speaks = recipient == BROADCAST
    np.testing.assert_array_equal(recipient[~speaks], np.flatnonzero(~speaks))
    return speaks


def planned(links, timestamp, now):
    """Who transmits first by a plan that begins with this T and these links."""
    plan = Plan(links, SETTINGS, is_certain=True, timestamp=timestamp, now=now)
    return plan.transmits(0)


@pytest.mark.parametrize("seed", range(5))
def test_a_slot_is_the_first_of_the_planners_plan_from_the_truth(seed):
    mission = paper("stationary", num_robots=12)
    team = flooded_team(mission, seed)
    found = speakers(started(mission), team.timestamp, team.now, team.position_m)
    links = links_between(team.radio, team.position_m)
    np.testing.assert_array_equal(found, planned(links, team.timestamp, team.now))
    assert np.any(found)


def test_several_first_transmitters_are_followed_ahead():
    """A plan that takes the best of each slot alone begins otherwise in some of these teams."""
    mission = paper("stationary", num_robots=12)
    myopic = PlannerSettings(rest_lookahead=(1, 1), max_lookahead_robots=100)
    differs = []
    for seed in range(8):
        team = flooded_team(mission, seed)
        links = links_between(team.radio, team.position_m)
        plan = Plan(links, myopic, is_certain=True, timestamp=team.timestamp, now=team.now)
        found = speakers(started(mission), team.timestamp, team.now, team.position_m)
        differs.append(np.any(found != plan.transmits(0)))
    assert any(differs)


def test_buffers_and_places_are_those_of_the_slot_and_weights_may_be_older():
    """After the weights' time, all is as if the team had been there from the start."""
    mission = paper("random-walk", num_robots=12)
    here = flooded_team(mission, 1)
    there = flooded_team(mission, 2)
    policy = started(mission)
    speakers(policy, here.timestamp, here.now, here.position_m)
    later = here.now + WEIGHED_SLOTS / 2
    links = links_between(there.radio, there.position_m)
    expected = planned(links, here.timestamp, later)
    found = speakers(policy, here.timestamp, later, there.position_m)
    np.testing.assert_array_equal(found, expected)
    # It sees the buffers that there are now, even where nobody has moved.
    everything = np.full_like(here.timestamp, later)
    assert not np.any(speakers(policy, everything, later - 0.5, there.position_m))


def test_links_are_those_of_the_slot_while_weights_are_kept():
    """Two robots come into range of each other one slot after they were weighed apart."""
    policy = started(paper("random-walk", num_robots=2))
    timestamp = np.diag([9.0, 9.0])
    apart_m = np.array([[0.0, 0.0], [400.0, 0.0]])
    assert not np.any(speakers(policy, timestamp, 9.0, apart_m))
    near_m = np.array([[0.0, 0.0], [100.0, 0.0]])
    assert np.sum(speakers(policy, timestamp, 9.5, near_m)) == 1
    assert not np.any(speakers(policy, timestamp, 10.0, apart_m))


def test_robots_that_failed_neither_speak_nor_are_spoken_to():
    """Robot 2 is the oldest to both others, but off, though nobody has moved since it was not."""
    position_m = np.array([[0.0, 0.0], [100.0, 0.0], [50.0, 50.0]])
    timestamp = np.array([[9.0, 9.0, 0.0], [9.0, 9.0, 0.0], [0.0, 0.0, 9.0]])
    policy = started(paper("stationary", num_robots=3))
    assert speakers(policy, timestamp, 9.0, position_m).tolist() == [False, False, True]
    off = np.array([True, True, False])
    expected = planned(
        among(links_between(radio_of(paper("stationary")), position_m), off), timestamp, 9.5
    )
    found = speakers(policy, timestamp, 9.5, position_m, off)
    assert not found[2]
    np.testing.assert_array_equal(found, expected)
    # News is weighed anew at once, since at rest nothing else would ask for it.
    assert policy._scenes[0].weighed == 2 * 9.5 + 1


def test_it_knows_the_walls_of_the_true_channel():
    """Two robots, 100 m apart, with 40 dB between them."""
    wall = Obstacles(
        kind=np.array([BOX]),
        centre_m=np.array([[50.0, 0.0, 0.0]]),
        rotation=np.eye(3)[None],
        size_m=np.array([[1.0, 1e4, 1e4]]),
        reach_m=np.array([2e4]),
        power_left=np.array([1e-4]),
    )
    mission = paper("stationary", num_robots=2)
    channel = mission_radio(mission, wall).channel
    channel.start(2, [np.random.default_rng(0)])
    position_m = np.array([[0.0, 0.0], [100.0, 0.0]])
    timestamp = np.diag([9.0, 9.0])
    assert np.sum(speakers(started(mission), timestamp, 9.0, position_m)) == 1
    informed = make_policy("lookahead-oracle", mission)
    informed.inform(TrueLinks(radio=radio_of(mission), channel=channel))
    informed.start(2, [np.random.default_rng(0)])
    assert not np.any(speakers(informed, timestamp, 9.0, position_m))


@pytest.mark.parametrize("task", ["random-walk", "flocking", "stationary"])
def test_it_beats_the_greedy_oracle_by_a_tenth_on_the_same_missions(task):
    mission = paper(task, num_robots=30, num_windows=120)
    seeds = range(20, 24)
    ahead = ages("lookahead-oracle", mission, seeds)
    greedy = ages("greedy-oracle", mission, seeds)
    assert np.all(ahead < greedy)
    assert np.mean(ahead) < 0.9 * np.mean(greedy)


@pytest.mark.parametrize("num_robots", [2, 3])
@pytest.mark.parametrize("task", ["random-walk", "stationary"])
def test_tiny_teams_know_each_other_at_once(task, num_robots):
    """Two robots at rest broadcast in turn: each is then a slot old at the end of a window."""
    mission = paper(task, num_robots=num_robots, num_windows=40)
    ahead = np.mean(ages("lookahead-oracle", mission, [1, 2]))
    assert ahead < np.mean(ages("tdma", mission, [1, 2])) + 1e-9
    if (task, num_robots) == ("stationary", 2):
        assert ahead == pytest.approx(0.125)  # the optimum of `docs/bounds.md`


HARD = {
    "fades": {"erasure": 0.2, "fading": "rayleigh", "shadowing_db": 4.0},
    "failures": {"failure_fraction": 0.3},
    "clocks": {"clock_offset_s": 0.01},
    "a bit rate": {"bit_rate": 9e3},
    "walls": {"arena": "blocks"},
    "the authors' half-duplex rule": {"preset": "reference"},
}


@pytest.mark.parametrize("fields", HARD.values(), ids=HARD)
def test_same_seeds_give_the_same_flights_side_by_side_and_alone(fields):
    mission = paper("random-walk", **{"num_robots": 10, "num_windows": 40} | fields)
    together = ages("lookahead-oracle", mission, [3, 4])
    np.testing.assert_array_equal(together, ages("lookahead-oracle", mission, [3, 4]))
    for seed, age in zip([3, 4], together, strict=True):
        np.testing.assert_array_equal(ages("lookahead-oracle", mission, [seed]), [age])
    assert np.all(together < 20.0)  # nobody is heard of at 40 / 2


def test_missions_do_not_remember_those_before():
    mission = paper("random-walk", num_robots=24, num_windows=30)
    policy = make_policy("lookahead-oracle", mission)
    summarise(rollout(Swarm(mission, [5]), policy))
    after = summarise(rollout(Swarm(mission, [6]), policy)).aoi_mean
    np.testing.assert_array_equal(after, ages("lookahead-oracle", mission, [6]))


def test_it_broadcasts_twice_and_is_centralised():
    mission = paper("random-walk", num_robots=4)
    policy = make_policy("lookahead-oracle", mission)
    assert policy.window(mission) == two_broadcasts(mission)
    assert policy.is_centralised
