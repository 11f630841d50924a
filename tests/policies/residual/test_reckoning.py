"""Slots as robots reckon them, against the radio itself."""

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.residual.reckoning import NOBODY, decoded_by, reckon, room_for
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.radio.power_law import power_law

RADIO = radio_of(paper("stationary"))
NUM_ROBOTS = 9
AT_1_M = RADIO.received_at_1_m_mw / RADIO.noise_mw
LAW = power_law(np.full(NUM_ROBOTS, AT_1_M))


def slot(seed):
    """Who transmits, two to four robots, and where all are [m]."""
    rng = np.random.default_rng(seed)
    transmits = rng.permutation(NUM_ROBOTS) < 2 + seed % 3
    return transmits, rng.uniform(-400.0, 400.0, (NUM_ROBOTS, 2))


def reckoned(transmits, position_m):
    room = room_for(NUM_ROBOTS)
    for senders in (~transmits, transmits):  # what was there before is gone
        reckon(senders, position_m, LAW, room)
    return room


def test_eqs_3_4_everyone_decodes_whom_the_radio_lets_it_decode():
    """Whoever transmits hears nobody, which is not reckoned with here."""
    everyone, num_heard = np.arange(NUM_ROBOTS), 0
    for seed in range(20):
        transmits, position_m = slot(seed)
        heard = RADIO(position_m[None], np.where(transmits, -1, everyone)[None])[0]
        room = reckoned(transmits, position_m)
        decoded = np.array([decoded_by(j, room, 0.0, RADIO.threshold) for j in everyone])
        expected = np.where(heard == everyone, NOBODY, heard)
        np.testing.assert_array_equal(decoded[~transmits], expected[~transmits])
        num_heard += np.sum(heard != everyone)
    assert num_heard > 20


@pytest.mark.parametrize("seed", range(4))
def test_eqs_1_2_powers_add_up_packet_by_packet(seed):
    transmits, position_m = slot(seed)
    room = reckoned(transmits, position_m)
    for j in range(NUM_ROBOTS):
        powers = {
            o: AT_1_M / np.sum((position_m[o] - position_m[j]) ** 2)
            for o in np.flatnonzero(transmits)
            if o != j
        }
        strongest = max(powers, key=powers.get)
        assert room.total[j] == pytest.approx(sum(powers.values()))
        assert room.strongest[j] == pytest.approx(powers[strongest])
        assert room.sender[j] == strongest


def test_eq3_a_packet_is_lost_to_as_much_more_interference_as_it_is_above_the_threshold():
    """At half the range it arrives with four times the least power, so there is room for three
    times the noise at a threshold of 1."""
    position_m = np.full((NUM_ROBOTS, 2), 1e6)
    position_m[:2] = (0.0, 0.0), (0.5 * np.sqrt(AT_1_M), 0.0)
    room = reckoned(np.arange(NUM_ROBOTS) == 0, position_m)
    assert decoded_by(1, room, 2.99, 1.0) == 0
    assert decoded_by(1, room, 3.01, 1.0) == NOBODY
    assert decoded_by(2, room, 0.0, 1.0) == NOBODY


def test_in_silence_nobody_is_decoded():
    room = reckoned(np.zeros(NUM_ROBOTS, dtype=bool), slot(1)[1])
    assert not np.any(room.total)
    assert {decoded_by(j, room, 0.0, RADIO.threshold) for j in range(NUM_ROBOTS)} == {NOBODY}
