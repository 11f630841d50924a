import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.simulation.swarm import Swarm
from training.ceiling import Annealed, anneal, mean_age, receptions

NOBODY_SENDS = np.arange(2)


@pytest.fixture(scope="module")
def links():
    swarm = Swarm(paper("stationary", num_robots=8, range_ratio=0.25), [3])
    return swarm.truth.links(swarm.states.position_m[0], 0)


def test_two_robots_that_take_turns_know_each_other_half_a_window_late():
    """In slots: r1 hears r0, then r0 hears r1. At the window's end r1's news is a slot old."""
    heard = np.array([[0, 0], [1, 1]])
    assert mean_age(heard) == pytest.approx((0.5 + 0.0) / 4)  # both own ages are 0


def test_a_period_of_two_windows_counts_both_ends():
    """r0 sends in the first of four slots alone, r1 in the second: ages 1, 0, then 3, 2 slots."""
    heard = np.array([[0, 0], [1, 1], NOBODY_SENDS, NOBODY_SENDS])
    assert mean_age(heard) == pytest.approx((0.5 + 0.0 + 1.5 + 1.0) / 4 / 2)


def test_the_age_of_a_period_is_that_of_its_missions(links):
    mission = paper("stationary", num_robots=8, range_ratio=0.25, num_windows=140)

    class Given(Annealed):
        """Flies a schedule that is given."""

        def start(self, num_robots, rngs):
            super().start(num_robots, rngs)
            self._schedules = [period]

    rng = np.random.default_rng(1)
    period, age = anneal(np.eye(8, dtype=bool), links, rng, 400, 0.05, 0.003)
    policy = Given(mission)
    swarm = Swarm(mission, [3])
    ages = [swarm.step(policy).age_windows[0] for _ in range(mission.num_windows)]
    assert np.mean(ages[-len(period) // 2 :]) == pytest.approx(age)


def test_a_search_never_ends_above_its_start(links):
    period = np.eye(8, dtype=bool)  # robots in turn
    start = mean_age(receptions(period, links))
    best, age = anneal(period, links, np.random.default_rng(1), 2000, 0.05, 0.003)
    assert age == pytest.approx(mean_age(receptions(best, links)))
    assert age < 0.8 * start  # robots far apart share slots, and relays follow senders


def test_only_robots_at_rest_can_fly_it():
    with pytest.raises(ValueError, match="task must be stationary, not flocking"):
        Annealed(paper("flocking"))
