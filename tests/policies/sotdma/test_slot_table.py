"""What robots remember, by hand: slots count from the start of the first frame."""

import numpy as np
import pytest

from swarm_mj.policies.sotdma.frame import Rule
from swarm_mj.policies.sotdma.slot_table import (
    LONG_AGO,
    NO_PLACE,
    are_in_need,
    empty_table,
    marks,
    place_of,
    read_packets,
    read_slots,
)

RULE = Rule(threshold=1.0, num_slots=3, contention_every=4)


def memory():
    """Of three robots that believe that robot k transmits in slot k."""
    table = empty_table(np.arange(3), 3)
    table.slots[...] = np.arange(3)
    return table


def test_every_fourth_slot_is_of_no_frame_and_the_others_count_on():
    no = NO_PLACE
    places = [place_of(slot, RULE) for slot in range(12)]
    assert places == [0, 1, 2, no, 0, 1, 2, no, 0, 1, 2, no]
    rule = Rule(threshold=1.0, num_slots=5, contention_every=3)
    assert [place_of(slot, rule) for slot in range(9)] == [0, 1, no, 2, 3, no, 4, 0, no]


def test_t_tells_a_teammates_slot():
    """Robot 2 transmitted in slot 5, the second of a frame; robot 1 before there were frames; slot
    7 is of no frame, so it tells nothing; older news changes nothing, nor does one's own T."""
    table = memory()
    known = np.full((3, 3), -1)
    known[0] = 6, -1, 5
    read_slots(table, known, RULE)
    assert table.slots[0].tolist() == [0, 1, 1]
    assert table.announced[0].tolist() == [LONG_AGO, LONG_AGO, 5]
    for slot in (3, 7):
        known[0, 2] = slot
        read_slots(table, known, RULE)
        assert table.slots[0, 2] == 1
        assert table.announced[0, 2] == 5


def hear(table, slot, sender, known_until, passed_by):
    """Robot 0 decodes a packet that says what its sender knows of it: T, and P."""
    known, parent = np.full((3, 3), -1), np.full((3, 3), -1)
    known[sender, 0], parent[sender, 0] = known_until, passed_by
    read_packets(table, np.array([sender, 1, 2]), known, parent, slot, RULE)


def test_a_packet_tells_whether_its_sender_decoded_ones_own():
    """Robot 0 transmitted in slot 14, place 2. Robot 1 decoded it; robot 2 knows of slot 10 only,
    and says so twice; then again, of what was sent in slot 18, it was told by robot 1."""
    table = memory()
    table.sent[0] = 14
    hear(table, 15, 1, 14, 1)
    hear(table, 16, 2, 10, 2)
    hear(table, 17, 2, 10, 2)
    assert table.missed[0, 2].tolist() == [0, 0, 1]
    assert table.missed_at[0].tolist() == [LONG_AGO, LONG_AGO, 16]
    assert table.decoded[0].tolist() == [LONG_AGO, 15, 17]
    assert table.got_through[0].tolist() == [LONG_AGO, 14, 10]
    assert table.outbound_delivery_ratio[0] == pytest.approx(0.9)
    table.sent[0] = 18
    hear(table, 19, 2, 18, 1)
    assert table.missed[0, 2].tolist() == [0, 0, 2]
    table.sent[0] = 22
    hear(table, 23, 2, 22, 2)
    assert table.missed[0, 2].tolist() == [0, 0, 0]
    assert np.all(table.missed[0, :2] == 0)


def test_misses_are_counted_up_to_a_hundred():
    table = memory()
    for n in range(150):
        table.sent[0] = 10 + 4 * n
        hear(table, 12 + 4 * n, 1, 5, 1)
    assert table.missed[0, 2, 1] == 100


@pytest.mark.parametrize("sent", [-1, 11, 16])
def test_a_packet_says_nothing_of_what_was_sent_in_no_frame_or_just_now(sent):
    """Before the first frame; in slot 11, the fourth of its four; in this slot."""
    table = memory()
    table.sent[0] = sent
    hear(table, 16, 1, 5, 1)
    assert not np.any(table.missed)
    assert table.outbound_delivery_ratio[0] == 1.0


@pytest.mark.parametrize(
    ("share", "enough"),
    [(1.0, 1), (0.95, 1), (0.7, 2), (0.5, 4), (0.0, 22)],  # 0.3² < 0.1 < 0.3; 0.5⁴ < 0.1; 0.9²²
)
def test_a_slot_is_marked_that_was_missed_more_often_than_by_chance(share, enough):
    table = memory()
    table.missed[0, :2, 1:] = [[enough - 1, enough], [enough, enough]]
    table.missed_at[0, :2], table.outbound_delivery_ratio[0] = [50, 29], share
    is_marked = marks(table, 0, 50, Rule(1.0, 2, min_miss_probability=0.1, marked_slots=20))
    assert is_marked[:2, 1:].tolist() == [[False, True], [False, False]]


def test_a_robot_is_in_need_that_lost_a_neighbour_or_is_lost_to_one():
    """At slot 40, with a patience of 6 slots, and 12 until it is gone: robot 1 is the neighbour of
    robot 0."""
    table, near = memory(), np.zeros((3, 3), dtype=bool)
    near[0, 1] = True
    rule = Rule(threshold=1.0, num_slots=3, need_frames=2.0, lost_frames=4.0)

    def needs(heard_of_slot, is_near=near):
        known = np.full((3, 3), 39)
        known[0, 1] = heard_of_slot
        in_need = are_in_need(table, known, is_near, 40, rule)
        assert not np.any(in_need[1:])
        return in_need[0]

    assert [needs(slot) for slot in (34, 33, 28, 27)] == [False, True, True, False]
    assert not needs(33, np.zeros((3, 3), dtype=bool))
    table.decoded[0, 1], table.got_through[0, 1] = 38, 31
    assert needs(38)
    table.got_through[0, 1] = 32
    assert not needs(38)


def test_what_was_decoded_too_long_ago_shows_no_need_any_more():
    """At slot 40 with a patience of 6 slots: a packet of slot 35 counts, and one of 34 does not,
    though both knew of nothing that the robot sent in the 7 slots before."""
    table, everyone = memory(), np.ones((3, 3), dtype=bool)
    rule = Rule(threshold=1.0, num_slots=3, need_frames=2.0, lost_frames=4.0)
    known = np.full((3, 3), 39)
    for decoded, expected in ((35, True), (34, False)):
        table.decoded[0, 1] = decoded
        table.got_through[0, 1] = decoded - 7
        assert are_in_need(table, known, everyone, 40, rule).tolist() == [expected, False, False]
