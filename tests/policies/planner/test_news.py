"""The value of news by hand."""

import numpy as np

from swarm_mj.policies.planner.news import value_of_news


def row(*numbers):
    return np.array(numbers, dtype=np.float32)


def test_each_rise_counts_squared_times_its_weight_and_what_is_older_counts_nothing():
    """3 slots newer of weight 2, 1 newer of weight 5, as new, and 4 older: 9 x 2 + 1 x 5."""
    value = value_of_news(row(7, 5, 3, 1), row(4, 4, 3, 5), row(2, 5, 9, 9))
    assert value == 18.0 + 5.0


def test_who_knows_as_much_gains_nothing():
    assert value_of_news(row(4, 2), row(4, 2), row(1, 1)) == 0.0
