"""First slots, worked out as far as they are needed, are equal to all at once."""

import numpy as np
import pytest
from small_frames import NUM_ROBOTS, RULE, team

from swarm_mj.mission import paper
from swarm_mj.policies.sotdma import first_slots
from swarm_mj.policies.sotdma.choices import work_out_slots
from swarm_mj.policies.sotdma.first_slots import FirstSlots
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.radio.power_law import PowerLaw, powers_between

EVERYONE = np.arange(NUM_ROBOTS)
ORDER = np.random.default_rng(1).permutation(NUM_ROBOTS)
RADIO = radio_of(paper("stationary"))
LAW = PowerLaw(np.full(NUM_ROBOTS, RADIO.received_at_1_m_mw / RADIO.noise_mw))


def believing(*places):
    """Robots of whom each believes in the positions of one of these teams, and knows all but one
    or two; robots 0 and 1 believe the same."""
    position_m = np.stack([team(seed)[0] for seed in places])
    is_known = (EVERYONE[:, None] + 1) % NUM_ROBOTS != EVERYONE
    is_known[1] = is_known[0] = EVERYONE > -1
    return position_m, is_known


@pytest.fixture
def worked_out(monkeypatch):
    """Whose slots were worked out: pairs of how many were done and will be, one for each time."""
    calls = []

    def counted(**arguments):
        calls.append((arguments["done"], arguments["num"]))
        work_out_slots(**arguments)

    monkeypatch.setattr(first_slots, "work_out_slots", counted)
    return calls


def at_once(position_m, is_known):
    slots = np.zeros(NUM_ROBOTS, dtype=np.int64)
    power = powers_between(position_m, LAW) * is_known[:, None] * is_known
    work_out_slots(slots, 0, NUM_ROBOTS, ORDER, is_known, power, RULE)
    return slots


def test_they_are_those_that_a_robot_works_out_at_once():
    """In parts, by what was believed at first."""
    position_m, is_known = believing(0, 0, *range(2, NUM_ROBOTS))
    expected = [at_once(position_m[i], is_known[i]) for i in EVERYONE]
    first = FirstSlots(ORDER, position_m, is_known, LAW, RULE)
    position_m[...], is_known[...] = 0.0, False
    assert first.own().tolist() == [expected[i][i] for i in EVERYONE]
    for i in range(NUM_ROBOTS):
        wanted = np.isin(EVERYONE, ORDER[[2, 5]])
        assert first.of(i, wanted)[wanted].tolist() == expected[i][wanted].tolist()
        assert first.of(i, EVERYONE > -1).tolist() == expected[i].tolist()


def test_a_robots_own_slot_needs_those_before_it_in_the_order_alone(worked_out):
    first = FirstSlots(ORDER, *believing(0, 0, *range(2, NUM_ROBOTS)), LAW, RULE)
    first.own()
    place = np.argsort(ORDER)
    alone = {(0, int(place[i]) + 1) for i in range(2, NUM_ROBOTS)}
    assert alone <= set(worked_out)
    assert len(worked_out) <= NUM_ROBOTS


def test_no_slot_is_worked_out_twice_nor_if_nobody_asks(worked_out):
    first = FirstSlots(ORDER, *believing(0, 0, *range(2, NUM_ROBOTS)), LAW, RULE)
    first.of(0, EVERYONE < 0)
    assert worked_out == []
    for i in (0, 1, 0):  # robots 0 and 1 believe the same
        first.of(i, EVERYONE > -1)
    assert worked_out == [(0, NUM_ROBOTS)]
