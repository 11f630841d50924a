"""What exports write of a flight: packets with slots and fates, times, velocities, ages."""

from dataclasses import replace

import numpy as np
import pytest

from swarm_mj.protocol.buffers import BROADCAST
from swarm_mj.replay.export.flown import FlownWindows, number
from swarm_mj.replay.read import read_flown
from swarm_mj.replay.write import write_replay


def all_packets(flown: FlownWindows):
    """Every packet with its row."""
    for row in range(len(flown.footage.window)):
        for packet in flown.packets(row):
            yield row, packet


def counted(flown, *fates):
    """How many packets with these fates each window has."""
    rows = [row for row, packet in all_packets(flown) if packet.fate in fates]
    return np.bincount(rows, minlength=len(flown.footage.window))


@pytest.mark.parametrize(("read", "flight"), [("requests", "two_way"), ("broadcasts", "flooded")])
def test_a_replay_keeps_whom_each_robot_addressed_and_decoded(request, read, flight):
    flown, log = request.getfixturevalue(read), request.getfixturevalue(flight).log
    np.testing.assert_array_equal(flown.recipient, log.recipient)
    np.testing.assert_array_equal(flown.heard, log.heard)
    np.testing.assert_allclose(flown.footage.position_m, log.position_m, atol=1e-4)
    np.testing.assert_allclose(flown.age_std, log.age_std, rtol=1e-12)
    np.testing.assert_allclose(flown.age_worst, log.age_max, rtol=1e-12)


@pytest.mark.parametrize("fate", ["delivered", "lost", "answered"])
def test_addressed_packets_have_the_fates_that_the_costs_count(requests, two_way, fate):
    assert two_way.counted(fate).sum() > 0
    np.testing.assert_array_equal(counted(requests, fate), two_way.counted(fate))


def test_all_packets_that_were_on_the_air_are_there(requests, two_way, broadcasts, flooded):
    fates = ("delivered", "lost", "answered", "unanswered")
    np.testing.assert_array_equal(counted(requests, *fates), two_way.counted("transmitted"))
    np.testing.assert_array_equal(counted(broadcasts, "heard"), flooded.counted("heard"))
    of_both = counted(broadcasts, "heard", "unheard")
    np.testing.assert_array_equal(of_both, flooded.counted("transmitted"))
    assert counted(broadcasts, "unheard").sum() > 0


def test_every_reception_is_of_one_packet(requests, two_way, broadcasts, flooded):
    receptions = np.zeros(len(broadcasts.footage.window))
    for row, packet in all_packets(broadcasts):
        receptions[row] += len(packet.receivers)
        assert packet.recipient is None
    np.testing.assert_array_equal(receptions, flooded.counted("receptions"))
    overheard = np.zeros(len(requests.footage.window))
    for row, packet in all_packets(requests):
        overheard[row] += sum(robot != packet.recipient for robot in packet.receivers)
    np.testing.assert_array_equal(overheard, two_way.counted("overheard"))


def test_packets_are_in_order_and_answers_are_in_the_second_slot(requests):
    places = [(row, packet.slot, packet.sender) for row, packet in all_packets(requests)]
    assert places == sorted(places)
    slots = {"delivered": 0, "lost": 0, "answered": 1, "unanswered": 1}
    assert all(packet.slot == slots[packet.fate] for _, packet in all_packets(requests))


def test_windows_of_100_ms_have_slots_of_50_ms(requests):
    assert requests.window_s == 0.1
    assert [requests.begin_s(0, slot) for slot in (0, 1)] == [0.0, 0.05]
    assert [requests.begin_s(3, slot) for slot in (0, 1)] == [0.3, 0.35]
    assert requests.end_s(3) == 0.4


def test_velocities_are_the_way_over_a_window(requests, two_way):
    assert np.all(np.isnan(requests.velocity_mps(0)))
    way_m = two_way.log.position_m[5] - two_way.log.position_m[4]
    np.testing.assert_allclose(requests.velocity_mps(5)[:, :2], way_m / 0.1, atol=2e-3)
    assert np.all(requests.velocity_mps(5)[:, 2] == 0.0)


def test_bodies_have_heights(bodies, high):
    """Rovers stay on the floor, their base 12.5 cm above it."""
    np.testing.assert_allclose(bodies.place_m[..., 2], high.log.height_m, atol=1e-4)
    assert np.ptp(bodies.place_m[:, :10, 2]) > 30.0
    np.testing.assert_allclose(bodies.place_m[:, 10:, 2], 0.125, atol=1e-6)


def test_bodies_that_climb_0_2_m_in_0_1_s_have_a_velocity_of_2_mps_upwards(climbing, bodies):
    velocity_mps = climbing.velocity_mps(20)
    np.testing.assert_allclose(velocity_mps[:, 2], 2.0, atol=1e-9)
    np.testing.assert_array_equal(velocity_mps[:, :2], bodies.velocity_mps(20)[:, :2])


def test_points_are_on_the_ground(requests):
    assert not requests.has_bodies
    assert np.all(requests.place_m[..., 2] == 0.0)


def test_ages_are_the_team_s_and_the_observer_s(requests, two_way):
    log = two_way.log
    ages = requests.ages(7)
    assert ages.mean == pytest.approx(log.age_mean[7], abs=1e-6)
    assert ages.std == pytest.approx(log.age_std[7], abs=1e-6)
    assert ages.worst == pytest.approx(log.age_max[7], abs=1e-6)
    known = [number(age) for age in log.known_age[7]]
    assert ages.known == known
    assert None in known  # the flight is short
    assert known[log.ego] == 0.0


@pytest.mark.parametrize(("sends_again", "receivers"), [(False, [[1, 2]]), (True, [[1], [2]])])
def test_a_late_packet_counts_for_its_sender_s_last_one(broadcasts, sends_again, receivers):
    """Robot 2 decodes robot 0 in the second slot, in which robot 0 is silent, or sends again."""
    silence = np.broadcast_to(np.arange(12), (30, 2, 12))
    recipient, heard = silence.copy(), silence.copy()
    recipient[0, 0, 0] = BROADCAST
    heard[0, 0, 1] = heard[0, 1, 2] = 0
    if sends_again:
        recipient[0, 1, 0] = BROADCAST
    flown = replace(broadcasts, recipient=recipient, heard=heard)
    assert [packet.receivers for packet in flown.packets(0)] == receivers


def test_a_replay_without_packets_is_refused_in_one_line(two_way, tmp_path, monkeypatch):
    monkeypatch.setattr("swarm_mj.replay.write.keep_packets", lambda _: None)
    write_replay(two_way.log, {"seed": 5}, tmp_path / "old.rrd")
    complaint = r"^\S*old\.rrd does not keep its packets by slot, .*; record it again$"
    with pytest.raises(ValueError, match=complaint):
        read_flown(tmp_path / "old.rrd")
