"""What robots note of their neighbours, by hand: three in a row, and many."""

import numpy as np
import pytest

from swarm_mj.policies.index.table import (
    KNOWS_ITSELF,
    LEFT_BEYOND,
    MAX_ROWS,
    NO_ROW,
    TAKEN_WITHIN,
    chance_within,
    empty_gain,
    empty_table,
    note_and_weigh,
)
from swarm_mj.policies.index.weights import START
from swarm_mj.protocol.buffers import ABSENT
from swarm_mj.protocol.timestamps import total_rise

RANGE_M = 100.0
WEIGHTS = START._replace(success=np.array([[0.75]]))
NOW = 20.0
NEAR = ((0.0, 0.0), (50.0, 0.0), (100.0, 0.0))  # the outer two are in range of each other


class Robot:
    """Robots of one mission who all believe the same; what they note is looked at."""

    def __init__(self, places, timestamp, is_known=None):
        num = len(places)
        self.table = empty_table(1, num)
        self.gain = empty_gain(1, num)
        places_m = np.array(places)
        self.places = np.broadcast_to(places_m, (1, num, *places_m.shape)).copy()
        self.timestamp = np.broadcast_to(np.array(timestamp, dtype=float), (1, num, num)).copy()
        self.is_known = np.ones((1, num, num), bool) if is_known is None else is_known

    def note(self, heard=None, sent=(), packet=None, earlier=None):
        num = self.timestamp.shape[1]
        nobody = np.zeros((1, num, num), np.float32)
        has_sent = np.zeros((1, num), bool)
        has_sent[0, list(sent)] = True
        note_and_weigh(
            table=self.table,
            gain=self.gain,
            timestamp=self.timestamp,
            is_known=self.is_known,
            position_m=self.places,
            now=np.array([NOW]),
            heard=np.arange(num)[None] if heard is None else np.array([heard]),
            has_sent=has_sent,
            packet=nobody if packet is None else np.array([packet], np.float32),
            earlier=nobody if earlier is None else np.array([earlier], np.float32),
            range_m=RANGE_M,
            weights=WEIGHTS,
        )

    def bound(self, i, j):
        """What robot i takes for T of j."""
        return self.table.bound[0, i, self.table.row[0, i, j]].tolist()


def team(timestamp=(18.0, 16.0, 14.0)):
    """Three robots that know each other, of whom nothing is noted beyond the mean age."""
    robots = Robot(NEAR, timestamp)
    robots.note()
    return robots


def test_a_newcomer_is_taken_to_be_behind_by_the_mean_age():
    """Ages of 2, 4 and 6 windows; one's own next entry is of 20.5."""
    robots = team()
    assert robots.bound(0, 1) == [20.5 - 4.0, KNOWS_ITSELF, 14.0 - 4.0]
    assert robots.bound(1, 0) == [KNOWS_ITSELF, 20.5 - 4.0, 14.0 - 4.0]


def test_what_a_robot_decoded_is_what_its_sender_knows_even_if_that_is_less():
    robots = team()
    robots.timestamp[0, 0, 1] = NOW
    packet = np.zeros((3, 3))
    packet[1] = (3.0, NOW, 15.0)
    robots.note(heard=[1, 1, 2], packet=packet)
    assert robots.bound(0, 1) == [3.0, KNOWS_ITSELF, 15.0]


def test_neighbours_near_the_sender_have_decoded_it_too_and_none_knows_less_for_it():
    """Robot 2 is half a range from the sender: it has what is new to it, 15 in place of 10."""
    robots = team()
    robots.timestamp[0, 0, 1] = NOW
    packet = np.zeros((3, 3))
    packet[1] = (3.0, NOW, 15.0)
    before = robots.bound(0, 2)
    robots.note(heard=[1, 1, 2], packet=packet)
    assert robots.bound(0, 2) == [before[0], NOW, KNOWS_ITSELF]
    robots.places[0, 0, 2] = (-1.0 * RANGE_M, 0.0)  # still a neighbour, but 1.5 ranges from it
    packet[1, 0] = 19.0
    robots.note(heard=[1, 1, 2], packet=packet)
    assert robots.bound(0, 2)[0] == before[0]


def test_heights_part_robots_too():
    """Robot 1 flies 3 ranges above, so it has no row; robot 2 flies 0.5 above, and keeps one."""
    places = ((0.0, 0.0, 0.0), (0.0, 0.0, 3.0 * RANGE_M), (0.0, 0.0, 0.5 * RANGE_M))
    robots = Robot(places, (18.0, 16.0, 14.0))
    robots.note()
    assert robots.table.row[0, 0, 1] == NO_ROW
    assert robots.table.row[0, 0, 2] != NO_ROW


def test_entries_that_a_packet_left_out_stay_as_they_were():
    robots = team()
    robots.timestamp[0, 0, 1] = NOW
    packet = np.full((3, 3), ABSENT)
    packet[1, 1] = NOW
    before = robots.bound(0, 1)
    robots.note(heard=[1, 1, 2], packet=packet)
    assert robots.bound(0, 1) == before


def test_a_packet_that_came_a_slot_late_is_the_one_sent_before():
    """The sender's own entry, 19.5, says that it was sent in the slot before."""
    robots = team()
    robots.timestamp[0, 0, 1] = NOW - 0.5
    packet = np.full((3, 3), NOW)
    earlier = np.zeros((3, 3))
    earlier[1] = (1.0, NOW - 0.5, 2.0)
    robots.note(heard=[1, 1, 2], packet=packet, earlier=earlier)
    assert robots.bound(0, 1) == [1.0, KNOWS_ITSELF, 2.0]


def test_what_a_robot_sent_came_to_neighbours_for_the_learned_share():
    """Of the 4 windows that robot 1 lacked of 20.5 and of 14, three quarters have come."""
    robots = team()
    packet = np.zeros((3, 3))
    packet[0] = (20.5, 16.0, 14.0)
    robots.note(sent=[0], packet=packet)
    assert robots.bound(0, 1) == [16.5 + 3.0, KNOWS_ITSELF, 10.0 + 3.0]
    assert robots.table.announced[0, 0].tolist() == [20.5, 16.0, 14.0]


def test_the_gain_is_what_all_in_reach_lack():
    """Half a range away links are certain, and a range away their chance is a logistic's."""
    robots = team()
    far = chance_within(1.0, WEIGHTS.reach[0, 0], 0.067)
    assert 0.5 < far < 1.0
    # Each neighbour lacks 4 windows of the robot itself and 4 of the third.
    assert robots.gain.total[0].tolist() == pytest.approx(
        [8 + 8 * far, 16.0, 8 + 8 * far], rel=1e-3
    )
    assert robots.gain.largest[0] == pytest.approx(8.0, rel=1e-3)
    assert robots.gain.neighbours[0].tolist() == pytest.approx([1 + far, 2.0, 1 + far], rel=1e-3)
    assert robots.gain.edge[0].tolist() == pytest.approx([1.0, 0.0, 1.0])


def test_unknown_robots_count_by_what_was_not_announced_yet():
    """Robot 0 knows nobody: its own 20.5 windows are news to 2 of 3, and half a window for each."""
    is_known = np.eye(3, dtype=bool)[None]
    robots = Robot(NEAR, (0.0, 0.0, 0.0), is_known)
    robots.note()
    share = WEIGHTS.stranger[0, 0] * 2 / 3
    assert robots.gain.total[0, 0] == pytest.approx(share * (0.5 + 20.5))
    packet = np.zeros((3, 3))
    packet[0, 0] = 20.5
    robots.note(sent=[0], packet=packet)
    assert robots.gain.total[0, 0] == pytest.approx(share * 0.5)


def test_rows_go_to_the_nearest_and_of_those_who_leave_to_others():
    num = MAX_ROWS + 8
    places = [(2.0 * k, 0.0) for k in range(num)]  # all within a range
    robots = Robot(places, np.full(num, 19.0))
    robots.note()
    has_row = np.flatnonzero(robots.table.row[0, 0] != NO_ROW)
    assert has_row.tolist() == list(range(1, MAX_ROWS + 1))
    # Those without a row count as those with one.
    part = total_rise(
        np.array([20.5, *[19.0] * (num - 1)], np.float32), robots.table.bound[0, 0, 0]
    )
    assert robots.gain.total[0, 0] == pytest.approx((num - 1) * part, rel=3e-3)
    left = robots.table.row[0, 0, 5]
    robots.places[0, 0, 5] = (1.01 * LEFT_BEYOND * RANGE_M, 0.0)
    robots.note()
    assert robots.table.row[0, 0, 5] == NO_ROW
    assert robots.table.neighbour[0, 0, left] == MAX_ROWS + 1


def test_a_neighbour_at_the_edge_keeps_its_row_until_it_is_clearly_away():
    robots = team()
    robots.places[0, 0, 2] = (0.5 * (TAKEN_WITHIN + LEFT_BEYOND) * RANGE_M, 0.0)
    robots.note()
    assert robots.table.row[0, 0, 2] != NO_ROW


def test_the_memory_of_rows_does_not_grow_with_the_cube_of_the_team():
    assert empty_table(1, 1000).bound.nbytes == 4 * MAX_ROWS * 1000**2
