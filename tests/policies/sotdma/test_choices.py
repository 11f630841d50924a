"""Choices against the same ones made with frames put together anew each time."""

import numpy as np
import pytest

from swarm_mj.policies.sotdma.choices import Rule, chosen, first_slots
from swarm_mj.policies.sotdma.periodic import NOWHERE, best_slot, empty_frame, move

RULE = Rule(threshold=1.25, interference=1.2, num_slots=4, frames=3, start_age=20.0, least_gain=0.2)
NO_MARKS = np.zeros((4, 7), dtype=bool)
EVERYONE = np.ones(7, dtype=bool)
NO_CHOICES = np.zeros((0, 2), dtype=np.int64)


def powers(seed, is_known=EVERYONE):
    """Powers of robots in a field of three ranges [noise]."""
    position = np.random.default_rng(seed).uniform(0.0, 3.0, (7, 2))
    squared = np.sum((position[:, None] - position) ** 2, axis=2)
    np.fill_diagonal(squared, np.inf)
    return 1.25 / squared * is_known * is_known[:, None]


def best(power, slots, k, own, least_gain=0.2, is_marked=NO_MARKS):
    """The best slot of k beside those who have one."""
    frame = empty_frame(power, 1.25, 1.2, 4, 3, 20.0)
    for j, slot in enumerate(slots):
        if j != k:
            move(frame, j, NOWHERE, slot)
    return best_slot(frame, k, own, least_gain, is_marked)


@pytest.mark.parametrize("seed", range(4))
def test_the_first_of_the_order_have_a_slot_each_and_the_others_choose_in_turn(seed):
    order, power = np.random.default_rng(seed).permutation(7), powers(seed)
    slots = first_slots(order, EVERYONE, power, RULE)
    assert slots[order[:4]].tolist() == [0, 1, 2, 3]
    for place in range(4, 7):
        so_far = np.full(7, NOWHERE)
        so_far[order[:place]] = slots[order[:place]]
        assert slots[order[place]] == best(power, so_far, order[place], 0, 0.0)


def test_robots_that_are_not_known_have_no_part_in_it():
    """But they count as in the slots of their places in the order."""
    order, is_known = np.arange(7), ~np.isin(np.arange(7), [2, 5])
    slots = first_slots(order, is_known, powers(1, is_known), RULE)
    assert slots[[0, 1, 2, 3, 5]].tolist() == [0, 1, 2, 3, 1]
    apart = powers(1)
    apart[[2, 5]] = apart[:, [2, 5]] = 0.0
    for k in (4, 6):
        so_far = [slots[j] if j < k and is_known[j] else NOWHERE for j in range(7)]
        assert slots[k] == best(apart, so_far, k, 0, 0.0)


@pytest.mark.parametrize("seed", range(6))
def test_a_robot_takes_the_best_slot_beside_where_it_believes_the_others(seed):
    power, rng = powers(seed), np.random.default_rng(seed)
    slots, is_marked = rng.integers(0, 4, 7), rng.random((4, 7)) < 0.3
    never = np.full(7, -100)
    choice = chosen(3, slots, never, EVERYONE, is_marked, NO_CHOICES, power, RULE)
    assert choice == best(power, slots, 3, slots[3], is_marked=is_marked)


@pytest.mark.parametrize("seed", range(6))
def test_choices_not_heard_of_are_predicted_in_their_order(seed):
    """Robots 5 and 1 chose in slots 50 and 52; 6 too, but was heard since; 3 is oneself."""
    power = powers(seed)
    slots = np.random.default_rng(seed).integers(0, 4, 7)
    announced = np.array([0, 51, 0, 0, 0, 49, 54])
    chose = np.array([(5, 50), (1, 52), (6, 53), (3, 53)])
    expected = slots.copy()
    for k in (5, 1):
        expected[k] = best(power, expected, k, expected[k])
    choice = chosen(3, slots, announced, EVERYONE, NO_MARKS, chose, power, RULE)
    assert choice == best(power, expected, 3, slots[3])
