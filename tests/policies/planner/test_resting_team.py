"""Learning at rest: sharing what robots know is nothing but an optimisation, and learning pays."""

import numpy as np
import pytest
from decentralised_reference import transmitters
from learning_reference import LearnedApart, learner

from swarm_mj.mission import paper
from swarm_mj.policies.planner.resting_team import CommonTimes
from swarm_mj.policies.planner.settings import LearningSettings
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.swarm import Swarm

CHANNELS = {
    "free space": {},
    "shadowing": {"shadowing_db": 6.0},
    "rayleigh": {"fading": "rayleigh"},
    "erasures": {"erasure": 0.3},
    "all of them": {"shadowing_db": 6.0, "fading": "rayleigh", "erasure": 0.2},
}


def flown(mission, policy, seeds, num_windows=60):
    return transmitters(Swarm(mission, seeds), policy, num_windows)


@pytest.mark.parametrize("channel", CHANNELS)
@pytest.mark.parametrize(("seed", "num_robots"), [(0, 6), (1, 7)])
def test_eq9_sharing_is_learning_apart(channel, seed, num_robots):
    """Every robot decides as one that holds what packets told it, and nothing else."""
    mission = paper("stationary", num_robots=num_robots, **CHANNELS[channel])
    apart = LearnedApart(mission, seed)
    apart.fly(60)
    plans = {key for mind in apart.minds for key in mind.plans}
    assert None in plans  # all begin with what they believe
    assert (len(plans) > 1) == (channel != "free space")


def test_a_robot_that_missed_the_best_table_flies_by_the_best_it_has():
    """Robot 3 decodes nothing while tables spread: it flies by its own, and by one of the others'
    as soon as it hears them again. Throughout it decides as one that holds its packets alone."""
    mission, num_calls = paper("stationary", num_robots=6, shadowing_db=6.0), 0
    radio = Swarm(mission, [0]).channel

    class Deaf:
        def __call__(self, position_m, recipient):
            nonlocal num_calls
            num_calls += 1
            heard = radio.at(np.array([num_calls - 1]), np.arange(1))(position_m, recipient)
            if 32 < num_calls <= 44:
                heard[0, 3] = 3
            return heard

    apart = LearnedApart(mission, 0, channel=Deaf())
    apart.fly(21)
    owners = [mind.flown.rank[1] for mind in apart.minds]
    assert owners[3] == 3
    assert 3 not in owners[:3] + owners[4:]
    apart.fly(3)
    assert apart.minds[3].took_over >= 1
    assert apart.minds[3].flown.rank[1] in owners[:3] + owners[4:]


@pytest.mark.parametrize("seed", range(2))
def test_in_free_space_the_planner_flies_as_without_a_payload(seed):
    mission = paper("stationary", num_robots=8)
    learned = flown(mission, learner(mission), [seed])
    plain = flown(mission, make_policy("planner --payload none", mission), [seed])
    np.testing.assert_array_equal(learned, plain)


def test_the_same_seed_is_the_same_flight_whatever_flies_beside():
    mission = paper("stationary", num_robots=6, shadowing_db=6.0, erasure=0.1)
    beside = flown(mission, learner(mission), [5, 3], 36)
    np.testing.assert_array_equal(beside, flown(mission, learner(mission), [5, 3], 36))
    alone = flown(mission, learner(mission), [3], 36)
    np.testing.assert_array_equal(alone[:, 0], beside[:, 1])
    assert np.any(beside[:, 0] != beside[:, 1])


def test_common_times_by_hand():
    """Rounds of 20 windows, or 40 slots, even for three robots: flown from slot 100 on, each for 60
    slots, made 30 before; and of 25 windows for 25 robots."""
    settings = LearningSettings(
        first_rounds=2.5, flown_rounds=1.5, spread_rounds=0.75, min_round_windows=20
    )
    times = CommonTimes(3, settings)
    assert [slot for slot in range(250) if times.are_made(slot)] == [70, 130, 190]
    assert [slot for slot in range(250) if times.are_flown(slot)] == [100, 160, 220]
    assert [times.begin(slot) for slot in (100, 159, 160, 221)] == [100, 100, 160, 220]
    larger = CommonTimes(25, settings)
    assert next(slot for slot in range(250) if larger.are_flown(slot)) == 125


def test_eq10_learning_pays_under_shadowing():
    """Four missions of 80 windows, of which the second half counts: 2.7 windows instead of 4.0."""
    mission, age = paper("stationary", num_robots=12, shadowing_db=6.0), {}
    for name, policy in (
        ("learns", learner(mission)),
        ("does not", make_policy("planner --payload none", mission)),
    ):
        swarm = Swarm(mission, range(4))
        windows = [swarm.step(policy).age_windows for _ in range(80)]
        age[name] = np.mean(windows[40:], axis=0)
    assert np.all(age["learns"] < age["does not"])
    assert np.mean(age["learns"]) < 0.85 * np.mean(age["does not"])
