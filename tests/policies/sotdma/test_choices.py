"""Choices against the same ones in frames that are put together anew each time."""

import numpy as np
import pytest
from small_frames import NUM_ROBOTS, NUM_SLOTS, RULE, aged, frame_of, team

from swarm_mj.policies.sotdma.choices import best_slot, choices_before, chosen, work_out_slots
from swarm_mj.policies.sotdma.frame import NOWHERE


@pytest.mark.parametrize("seed", range(6))
def test_the_best_slot_is_the_youngest_of_all_that_were_tried(seed):
    """The frame is as before; a marked listener is deaf; the least gain keeps the present slot."""
    _, power = team(seed)
    rng = np.random.default_rng(seed)
    slots = rng.integers(0, NUM_SLOTS, NUM_ROBOTS)
    slots[4] = NOWHERE
    frame = frame_of(power, slots)
    before = frame.heard.copy(), frame.slot.copy()
    is_marked = rng.random((NUM_SLOTS, NUM_ROBOTS)) < 0.6
    ages = []
    for s in range(NUM_SLOTS):
        heard = frame_of(power, [*slots[:4], s, *slots[5:]]).heard
        deaf = (heard[s] == 4) & is_marked[s]
        heard[s] = np.where(deaf & (np.arange(NUM_ROBOTS) != 4), np.arange(NUM_ROBOTS), heard[s])
        ages.append(aged(heard))
    worst, apart = int(np.argmax(ages)), max(ages) - min(ages)
    for own, min_gain in ((0, 0.0), (worst, 0.5 * apart)):
        chosen = best_slot(frame, 4, own, min_gain, is_marked)
        assert ages[chosen] == pytest.approx(min(ages), rel=1e-5)
    assert best_slot(frame, 4, worst, 1.5 * apart, is_marked) == worst
    np.testing.assert_array_equal(frame.heard, before[0])
    np.testing.assert_array_equal(frame.slot, before[1])


EVERYONE = np.ones(NUM_ROBOTS, dtype=bool)
NO_MARKS = np.zeros((NUM_SLOTS, NUM_ROBOTS), dtype=bool)


@pytest.mark.parametrize("spare", [5e-9, -5e-9])
def test_between_equals_rounding_decides_and_ones_own_slot_still_needs_no_gain(spare):
    """The gain from the worst slot to the best is all but exactly the least that a move must bring:
    within what counts as equal, so that the sums by robots decide."""
    _, power = team(2)
    slots = np.random.default_rng(2).integers(0, NUM_SLOTS, NUM_ROBOTS)
    slots[4] = NOWHERE
    ages = [
        aged(frame_of(power, np.where(np.arange(NUM_ROBOTS) == 4, slot, slots)).heard)
        for slot in range(NUM_SLOTS)
    ]
    worst, youngest = int(np.argmax(ages)), int(np.argmin(ages))
    min_gain = ages[worst] - ages[youngest] + spare
    expected = worst if spare > 0.0 else youngest
    assert best_slot(frame_of(power, slots), 4, worst, min_gain, NO_MARKS) == expected


def best(power, slots, k, own, min_gain=RULE.min_gain, is_marked=NO_MARKS):
    """The best slot of k beside those who have one."""
    others = np.where(np.arange(NUM_ROBOTS) == k, NOWHERE, slots)
    return best_slot(frame_of(power, others, RULE.interference), k, own, min_gain, is_marked)


@pytest.mark.parametrize("unknown", [[], [1], [2, 7]])
def test_the_first_of_the_order_have_a_slot_each_and_the_others_choose_in_turn(unknown):
    """Robots that are not known have no part in it, but count as in the slots of their places."""
    is_known = ~np.isin(np.arange(NUM_ROBOTS), unknown)
    order, power = np.random.default_rng(4).permutation(NUM_ROBOTS), team(4)[1]
    power = power * is_known * is_known[:, None]
    slots = np.zeros(NUM_ROBOTS, dtype=np.int64)
    for done, num in ((0, 3), (3, 7), (7, NUM_ROBOTS)):  # in parts, as they are needed
        work_out_slots(slots, done, num, order, is_known, power, RULE)
    assert slots[order[:NUM_SLOTS]].tolist() == list(range(NUM_SLOTS))
    for place in range(NUM_SLOTS, NUM_ROBOTS):
        k, so_far = order[place], np.full(NUM_ROBOTS, NOWHERE)
        before = [j for j in order[:place] if is_known[j]]
        so_far[before] = slots[before]
        expected = best(power, so_far, k, 0, 0.0) if is_known[k] else place % NUM_SLOTS
        assert slots[k] == expected


def test_everyone_chooses_once_in_four_frames_but_not_in_the_first():
    """Nine robots in 20 slots of four frames of five: the nth chooses in slot 20 n / 9."""
    before = [choices_before(slot, 9, RULE) for slot in range(46)]
    expected = [sum(20 * n // 9 == slot for n in range(30)) for slot in range(45)]
    assert np.diff(before).tolist() == [0] * 5 + expected[5:]
    assert before[40] - before[20] == 9


@pytest.mark.parametrize("seed", range(6))
def test_a_robot_takes_the_best_slot_beside_where_it_believes_the_others(seed):
    """Choices not heard of are predicted first, in their order, without marks. In slots 51, 53, 55
    and 57 of the nine before chose robots 5, 1, 6, and 3, oneself; 6 was heard since."""
    power, rng = team(seed)[1], np.random.default_rng(seed)
    slots, is_marked = rng.integers(0, NUM_SLOTS, NUM_ROBOTS), rng.random(NO_MARKS.shape) < 0.3
    announced = np.array([0, 52, 0, 0, 0, 49, 56, 0, 0])
    order = np.array([0, 2, 4, 7, 8, 5, 1, 6, 3])
    for num_predicted, predicted in ((0, []), (9, [5, 1])):
        expected, rule = slots.copy(), RULE._replace(predicted_slots=num_predicted)
        for k in predicted:
            expected[k] = best(power, expected, k, expected[k])
        choice = chosen(3, slots, announced, EVERYONE, is_marked, order, 60, power, rule)
        assert choice == best(power, expected, 3, slots[3], is_marked=is_marked)
