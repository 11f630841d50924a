"""What packets weigh, what arrives of a buffer at those widths, and which entries are sent."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.packets import (
    check_whole,
    fitting,
    packet_of,
    slot_bytes,
)
from swarm_mj.simulation.swarm import Swarm


def test_the_bytes_of_a_buffer_by_hand():
    """An entry: age 2, position 4, velocity 2, parent 1; in the header, a bit for each robot."""
    assert packet_of(paper(num_robots=40)).num_bytes == 1 + 1 + 5 + 40 * 9 == 367
    assert packet_of(paper(num_robots=255)).num_bytes == 1 + 1 + 32 + 255 * 9
    assert packet_of(paper(num_robots=256)).num_bytes == 2 + 2 + 32 + 256 * 10


def test_the_planners_two_snapshots_by_hand():
    """Of 40 robots: owner 1, known 5, ages 80, positions 160, spread 2, and 1600 ages of pairs."""
    mission = paper(num_robots=40)
    snapshot = 1 + 5 + 2 * 40 + 4 * 40 + 2 + 2 * 40 * 40
    assert make_policy("planner", mission).packet(mission).num_bytes == 367 + 2 * snapshot == 7263


@pytest.mark.parametrize("task", ["random-walk", "flocking"])
def test_a_flown_buffer_comes_back_within_half_a_step(task):
    """Written bit by bit and read back: exact ages and parents, positions within 1 cm."""
    mission = paper(task, num_robots=40, num_windows=60)
    swarm, policy = Swarm(mission, [3]), make_policy("gossip", mission)
    for _ in range(60):
        swarm.step(policy)
    packet, buffers = packet_of(mission), swarm.buffers
    age, position, velocity, parent = packet.entry
    for i in (0, 17):
        known = np.flatnonzero(buffers.is_known[0, i])
        sent = {
            age: swarm.now[0] - buffers.timestamp[0, i, known],
            position: buffers.position_m[0, i, known],
            velocity: buffers.velocity_mps[0, i, known],
            parent: buffers.parent[0, i, known].astype(float),
        }
        bits = "".join(
            format(code, f"0{field.bits}b")
            for k in range(len(known))
            for field, values in sent.items()
            for code in codes(field, values[k : k + 1]).ravel().tolist()
        )
        header_bits = sum(field.bits * field.count for field in packet.header)
        weighed = replace(packet, num_entries=len(known)).num_bytes
        assert weighed == math.ceil((header_bits + len(bits)) / 8)
        read = {field: [] for field in sent}
        place = 0
        for _ in known:
            for field, values in read.items():
                for _ in range(field.count):
                    values.append(field.low + field.step * int(bits[place : place + field.bits], 2))
                    place += field.bits
        np.testing.assert_array_equal(read[age], sent[age])
        np.testing.assert_array_equal(read[parent], sent[parent])
        np.testing.assert_allclose(read[position], sent[position].ravel(), rtol=0, atol=0.01)
        np.testing.assert_allclose(read[velocity], sent[velocity].ravel(), rtol=0, atol=0.012)


def codes(field, values):
    """The nearest codes; numbers beyond the last code are sent as the last."""
    steps = np.rint((values - field.low) / field.step)
    return np.clip(steps, 0, 2**field.bits - 1).astype(int)


def rounded(field, values):
    """As a receiver reads them."""
    return field.low + field.step * codes(field, values)


def test_what_rests_is_read_as_resting_and_what_was_rounded_stays():
    _, position, velocity, _ = packet_of(paper("stationary")).entry
    assert rounded(velocity, np.zeros(2)).tolist() == [0.0, 0.0]
    values = np.linspace(-500.0, 500.0, 999)
    once = rounded(position, values)
    assert np.abs(once - values).max() <= position.step / 2 + 1e-9
    np.testing.assert_array_equal(rounded(position, once), once)


@pytest.mark.parametrize(("rate", "holds"), [(6e6, 37_500), (250e3, 1562), (160.0, 1), (159.0, 0)])
def test_a_slot_of_50_ms_holds_the_bits_of_50_ms(rate, holds):
    assert slot_bytes(paper(bit_rate=rate)) == holds


def test_entries_that_fit_to_the_byte():
    """Three entries of 9 bytes and 7 of header take 34; a byte less leaves room for two."""
    for room, entries in ((367, 40), (366, 39), (34, 3), (33, 2), (16, 1)):
        mission = paper(bit_rate=room * 8 / 0.05)
        packet = fitting(packet_of(mission), mission, "mine")
        assert packet.num_entries == entries
        assert packet.num_bytes <= room


def test_no_room_for_one_entry_is_refused_with_the_rate_that_is_needed():
    mission = paper(bit_rate=15 * 160.0)
    message = r"of mine need 16 bytes for a single entry, but a slot holds 15 bytes at 2.4 kbit/s; "
    with pytest.raises(ValueError, match=message + "choose a bit rate of 2560 or more"):
        fitting(packet_of(mission), mission, "mine")


def test_the_rate_that_is_said_to_do_does():
    """10,129 bytes in 150 ms take 540,213.3 bit/s; rounded down, they would not fit."""
    mission = paper(num_robots=1000, window_s=0.3, bit_rate=1000.0)
    with pytest.raises(ValueError, match="choose a bit rate of") as refused:
        check_whole("credit", mission)
    (said,) = re.findall(r"rate of (\d+) or more", str(refused.value))
    assert said == "540214"
    check_whole("credit", replace(mission, bit_rate=float(said)))
