import math

import numpy as np
import pytest

from swarm_mj.policies.planner.assent import Assent, turns_every
from swarm_mj.policies.planner.settings import PlannerSettings

SETTINGS = PlannerSettings()


@pytest.mark.parametrize("learns", [True, False])
def test_the_slots_for_turns_visit_every_robot(learns):
    for num_robots in range(2, 101):
        every = turns_every(num_robots, SETTINGS, learns=learns)
        assert every >= (3 if learns else 8)
        assert math.gcd(every, num_robots) == 1
        owners = {slot % num_robots for slot in range(0, every * num_robots, every)}
        assert owners == set(range(num_robots))


def told(delays, assents, num_slots):
    """Who knows at the end that all assent, if news of i is so many slots old at j, [j, i]."""
    num_robots = len(delays)
    assent = Assent(num_robots, SETTINGS)
    known = []
    for slot in range(num_slots):
        can_plan = np.array([until is None or slot < until for until in assents])
        known.append(assent.tell(slot, can_plan, slot - np.asarray(delays)))
    return np.array(known)


def test_all_know_it_as_late_as_the_news_of_it_comes():
    delays = np.array([[0, 3, 5], [3, 0, 2], [5, 2, 0]])
    known = told(delays, [None, None, None], 12)
    np.testing.assert_array_equal(np.argmax(known, axis=0), [5, 3, 5])
    assert np.all(known[5:])


def test_who_is_told_that_one_no_longer_hears_of_all_gives_way():
    delays = np.array([[0, 3, 5], [3, 0, 2], [5, 2, 0]])
    known = told(delays, [None, None, 8], 20)
    np.testing.assert_array_equal(np.flatnonzero(known[:, 0]), range(5, 13))
    np.testing.assert_array_equal(np.flatnonzero(known[:, 1]), range(3, 10))
    np.testing.assert_array_equal(np.flatnonzero(known[:, 2]), range(5, 8))


def test_who_misses_news_gives_way_by_itself_and_so_do_the_others_in_time():
    overdue = round(2 * 3 * SETTINGS.overdue_rounds)
    delays = np.ones((3, 3), dtype=int)
    delays[0, 2] = overdue
    assert np.all(told(delays, [None] * 3, 40)[-1])
    delays[0, 2] = overdue + 1
    assert not np.any(told(delays, [None] * 3, 40)[-1])
