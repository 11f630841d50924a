"""One team's robots: when they choose, what they predict, and when they contend."""

import math

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.sotdma.slot_table import NO_PLACE, place_of
from swarm_mj.policies.sotdma.team import SotdmaSettings, SotdmaTeam
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.radio.mission_radio import Belief, radio_of

NUM_ROBOTS, FIRST = 12, 36  # the first slot of a frame, of 11 slots
ORDER = np.random.default_rng(0).permutation(NUM_ROBOTS)
SILENCE, NO_DRAW = np.arange(NUM_ROBOTS), np.ones(NUM_ROBOTS)
RADIO = radio_of(paper("stationary"))  # decodes up to 250 m in silence


def buffers_of(position_m, now=5.0):
    """All know where all are, since t = 1, and observe themselves now."""
    buffers = empty_buffers(1, NUM_ROBOTS)
    buffers.timestamp[...] = 1.0
    buffers.timestamp[0, SILENCE, SILENCE] = now
    buffers.position_m[...] = position_m
    return buffers


def row(apart_m=200.0):
    return buffers_of(np.stack([apart_m * np.arange(NUM_ROBOTS), np.zeros(NUM_ROBOTS)], axis=1))


def begun(buffers, **numbers):
    """A team in its first frame."""
    team = SotdmaTeam(ORDER, Belief(radio=RADIO), SotdmaSettings(**numbers))
    in_turn = SILENCE == 3
    for slot in (0, FIRST - 1):
        transmits = team.transmits(slot, in_turn, buffers, 0, SILENCE, NO_DRAW)
        np.testing.assert_array_equal(transmits, in_turn)
    assert team.takes_turns
    team.transmits(FIRST, in_turn, buffers, 0, SILENCE, NO_DRAW)
    assert not team.takes_turns
    return team


@pytest.mark.parametrize(
    ("num_robots", "num_slots"), [(2, 2), (5, 5), (10, 10), (20, 14), (40, 20), (80, 29)]
)
def test_frames_grow_with_the_root_of_the_team_and_are_never_longer_than_a_round(
    num_robots, num_slots
):
    assert SotdmaSettings().frame_slots(num_robots) == num_slots


def test_everyone_chooses_once_in_four_frames_but_not_in_the_first():
    team = begun(row())
    frames = team._frames
    assert (frames.first_slot, frames.num_slots, frames.contention_every) == (FIRST, 11, 16)
    assert [team._choosers(slot, frames) for slot in range(FIRST, FIRST + 11)] == [[]] * 11
    choosers = [i for slot in range(FIRST + 44, FIRST + 88) for i in team._choosers(slot, frames)]
    assert choosers == ORDER.tolist()
    lately = team._chose_lately(FIRST + 88, frames)
    assert lately[:, 0].tolist()[-12:] == ORDER.tolist()
    assert np.all((np.diff(lately[:, 1]) >= 0) & (lately[1:, 1] < FIRST + 88))
    assert lately[0, 1] >= FIRST + 88 - 48


def test_robots_that_believe_the_same_work_out_the_same_first_slots():
    """The one that believes otherwise may work out others; all own the slots of their own table."""
    buffers = row()
    buffers.position_m[0, 5] = buffers.position_m[0, 5, ::-1]
    team = begun(buffers)
    slots = team._table.slots
    others = np.delete(SILENCE, 5)
    assert np.all(slots[others] == slots[0])
    for slot in range(FIRST + 1, FIRST + 11):
        transmits = team.transmits(slot, SILENCE < 0, buffers, 0, SILENCE, NO_DRAW)
        np.testing.assert_array_equal(transmits, np.diagonal(slots) == slot - FIRST)
        np.testing.assert_array_equal(team._table.sent == slot, transmits)


def test_robots_in_need_contend_where_nobody_owns_the_slot():
    """Robots 200 m apart in a row hear their neighbours; all but robots 0 and 1 heard of both of
    theirs a slot ago. Of those in need, the draw picks some."""
    buffers = row()
    slot = next(
        slot
        for slot in range(FIRST, FIRST + 99)
        if place_of(slot, begun(buffers)._frames) == NO_PLACE
    )
    now = (slot + 1) / 2
    buffers.timestamp[0] = np.where(np.abs(SILENCE[:, None] - SILENCE) <= 1, now - 0.5, 1.0)
    lost = now - math.ceil(3.0 * 11) / 2 - 1.0  # a bit more than three frames of 11 slots
    buffers.timestamp[0, 0, 1] = buffers.timestamp[0, 1, 0] = lost
    for draw, expected in ((0.39, [0, 1]), (0.41, [])):
        transmits = begun(row()).transmits(
            slot, SILENCE < 0, buffers, 0, SILENCE, np.full(NUM_ROBOTS, draw)
        )
        assert np.flatnonzero(transmits).tolist() == expected
