"""Asynchronous clocks: packets that overlap in part by hand, late packets, and equal clocks."""

import numpy as np
import pytest
from turns import settled

from swarm_mj.mission import paper, reference
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.asynchronous_window import UnderWay, window
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.radio.asynchronous import AIRTIME, GUARD, AsynchronousChannel, decode_overlapping
from swarm_mj.radio.composed import ComposedChannel
from swarm_mj.radio.mission_radio import mission_radio, radio_of
from swarm_mj.radio.power_law import PowerLaw
from swarm_mj.radio.reception import Reception
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm

NOISE_MW, THRESHOLD = 1.0, 2.0
A, B, C = range(3)
BEFORE, LAST, NOW = range(3)


def decode(packets, lag, powers_mw, **rule):
    """Whom each of three robots decodes now; packets are pairs of slot and sender, for all."""
    recipient = np.tile(np.arange(3), (3, 1, 1))
    power_mw = np.zeros((3, 1, 3, 3))
    for slot, sender in packets:
        recipient[slot, 0, sender] = -1
        for receiver in (A, B, C):
            power_mw[slot, 0, sender, receiver] = powers_mw.get((sender, receiver), 0.0)
    lags = np.tile(np.array(lag, dtype=float), (3, 1, 1))
    key, slot = np.zeros(1, np.uint64), np.zeros(1, np.int64)
    reception = Reception(noise_mw=NOISE_MW, threshold=THRESHOLD, **rule)
    return decode_overlapping(lags, recipient, power_mw, slot, key, reception)[0].tolist()


@pytest.mark.parametrize(("jam_mw", "is_decoded"), [(7.9, True), (8.1, False)])
def test_half_of_an_overlapping_packet_interferes_by_half(jam_mw, is_decoded):
    """SINR is 10 / (1 + jam / 2), and 2 is needed: a jam of 8 mW, or of 4 mW in full."""
    lag = (0.0, AIRTIME / 2.0, 0.0)
    heard = decode([(NOW, A), (NOW, B)], lag, {(A, C): 10.0, (B, C): jam_mw})
    assert heard[C] == (A if is_decoded else C)
    in_full = decode([(NOW, A), (NOW, B)], (0.0, 0.0, 0.0), {(A, C): 10.0, (B, C): jam_mw})
    assert in_full[C] == C


@pytest.mark.parametrize(("slot", "heard"), [(NOW, C), (LAST, B)])
def test_a_packet_beyond_the_guard_interval_is_decoded_one_slot_later(slot, heard):
    assert decode([(slot, B)], (0.0, GUARD + 0.01, 0.0), {(B, C): 10.0})[C] == heard


@pytest.mark.parametrize(("slot", "heard"), [(NOW, B), (LAST, C)])
def test_a_packet_within_the_guard_interval_is_decoded_in_its_slot(slot, heard):
    assert decode([(slot, B)], (0.0, GUARD, 0.0), {(B, C): 10.0})[C] == heard


def test_the_next_slot_hurts_the_end_of_a_late_packet():
    """B lags by 0.6: A's next packet begins 0.4 slots after it, so half of B's is jammed."""
    powers = {(B, C): 10.0, (A, C): 8.1}
    lag = (0.0, 0.6, 0.0)
    assert decode([(LAST, B)], lag, powers)[C] == B
    assert decode([(LAST, B), (NOW, A)], lag, powers)[C] == C
    assert decode([(LAST, B), (NOW, A)], lag, {**powers, (A, C): 7.9})[C] == B


def test_the_end_of_a_late_packet_hurts_the_next_slot():
    lag, powers = (0.0, 0.6, 0.0), {(A, C): 10.0, (B, C): 8.1}
    assert decode([(NOW, A), (LAST, B)], lag, powers)[C] == C
    assert decode([(NOW, A), (LAST, B)], lag, {**powers, (B, C): 7.9})[C] == A


def test_packets_of_two_slots_that_do_not_overlap_leave_each_other_alone():
    lag, powers = (0.15, 0.21, 0.0), {(A, C): 10.0, (B, C): 1e6}
    assert decode([(LAST, A), (NOW, B)], lag, powers)[C] == C  # both end in other slots
    assert decode([(NOW, A), (BEFORE, B)], lag, powers)[C] == A


def test_a_robot_is_deaf_while_it_transmits_even_for_a_part():
    powers = {(A, C): 1e6}
    assert decode([(NOW, A), (NOW, C)], (0.0, 0.0, 0.79), powers)[C] == C
    assert decode([(NOW, A), (NOW, C)], (0.0, 0.0, 0.81), powers)[C] == A


def test_under_the_authors_half_duplex_the_addressee_hears_all_the_same():
    lag, powers = np.zeros((3, 1, 3)), np.zeros((3, 1, 3, 3))
    powers[NOW, 0, A, C] = 10.0
    recipient = np.tile(np.arange(3), (3, 1, 1))
    recipient[NOW, 0] = C, B, A  # A and C address each other
    rule = Reception(noise_mw=NOISE_MW, threshold=THRESHOLD, recipient_hears_while_sending=True)
    key, slot = np.zeros(1, np.uint64), np.zeros(1, np.int64)
    assert decode_overlapping(lag, recipient, powers, slot, key, rule)[0, C] == A


def test_of_packets_that_end_in_a_slot_the_strongest_that_decodes_counts():
    lag = (0.0, 0.21, 0.0)  # B's overlaps A's by 0.01 slots
    assert decode([(NOW, A), (LAST, B)], lag, {(A, C): 10.0, (B, C): 9.0})[C] == A
    assert decode([(NOW, A), (LAST, B)], lag, {(A, C): 9.0, (B, C): 10.0})[C] == B


def clocked(**fields):
    """The channel of a mission whose clocks differ."""
    channel = mission_radio(paper("stationary", **fields)).channel
    assert isinstance(channel, AsynchronousChannel)
    return channel


def channels(preset, offset=0.0, drift=0.0):
    """The same channel with a common clock and without."""
    fields = dict(num_robots=12, fading="rayleigh", erasure=0.1, burst_begin=0.02)
    mission = preset("stationary", **fields)
    made = []
    for wrap in (lambda each: each, lambda each: AsynchronousChannel(each, offset, drift)):
        channel = wrap(mission_radio(mission).channel)
        channel.start(12, [np.random.default_rng(seed) for seed in range(5)])
        made.append(channel)
    return made


@pytest.mark.parametrize("preset", [paper, reference])
def test_with_equal_clocks_it_decodes_as_the_channel_itself(preset):
    common, own = channels(preset)
    rng, num_heard = np.random.default_rng(0), 0
    for n in range(40):
        position_m = rng.uniform(-300.0, 300.0, (5, 12, 2))
        everyone = np.arange(12)
        recipient = np.where(rng.random((5, 12)) < 0.2, rng.integers(0, 12, (5, 12)), everyone)
        slot, mission = np.full(5, n), np.arange(5)
        heard = common.at(slot, mission)(position_m, recipient.copy())
        np.testing.assert_array_equal(own.at(slot, mission)(position_m, recipient), heard)
        num_heard += np.sum(heard != everyone)
    assert num_heard > 100


@pytest.mark.parametrize("name", ["tdma", "random-flooding", "mst"])
def test_with_equal_clocks_missions_are_the_same_to_the_last_bit(name):
    mission = paper("random-walk", num_robots=10, num_windows=40)
    radio = radio_of(mission)
    law = PowerLaw(np.full(10, radio.received_at_1_m_mw))
    composed = ComposedChannel(law, Reception(noise_mw=radio.noise_mw, threshold=radio.threshold))
    flown = []
    for channel in (None, AsynchronousChannel(composed, 0.0, 0.0)):
        swarm = Swarm(mission, [3, 4], channel=channel)
        ages = [each.costs.age_windows for each in rollout(swarm, make_policy(name, mission))]
        flown.append((np.array(ages), swarm.buffers))
    np.testing.assert_array_equal(flown[0][0], flown[1][0])
    for field in ("timestamp", "position_m", "parent"):
        np.testing.assert_array_equal(*(getattr(buffers, field) for _, buffers in flown))


def test_clocks_are_uniform_and_drift_by_the_slot():
    channel = clocked(num_robots=1000, clock_offset_s=0.02, clock_drift_ppm=200.0)
    channel.start(1000, [np.random.default_rng(1)])
    lags = [channel.lag(np.array([slot]))[0] for slot in (0, 500)]
    assert [np.min(lag) for lag in lags] == [0.0, 0.0]
    assert np.max(lags[0]) == pytest.approx(0.4, abs=0.01)  # 20 of 50 ms
    assert np.mean(lags[0]) == pytest.approx(0.2, abs=0.02)
    drift = lags[1] - lags[0]
    assert np.ptp(drift) == pytest.approx(500 * 2 * 200e-6, rel=0.02)


def test_a_robot_that_falls_behind_by_a_slot_begins_anew():
    channel = clocked(num_robots=2, clock_drift_ppm=10_000.0)
    channel.start(2, [np.random.default_rng(1)])
    lag = np.array([np.max(channel.lag(np.array([slot]))) for slot in range(1000)])
    step = np.diff(lag)
    assert np.max(lag) < 1.0
    assert np.sum(step < 0.0) == int(1000 * step[0])
    np.testing.assert_allclose(step % 1.0, step[0], atol=1e-9)


def test_a_missions_clocks_do_not_depend_on_those_beside_it():
    fields = dict(num_robots=10, num_windows=30, clock_offset_s=0.04, fading="rayleigh")
    mission = paper("stationary", **fields)
    flown = []
    for seeds in ([5, 6, 7], [6]):
        swarm = Swarm(mission, seeds)
        policy = make_policy("gossip", mission)
        flown.append([each.costs.age_windows for each in rollout(swarm, policy)])
    np.testing.assert_array_equal(np.array(flown[0])[:, 1], np.array(flown[1])[:, 0])


class Lagging(AsynchronousChannel):
    """Clocks by hand."""

    def lag(self, slot):  # noqa: ARG002
        return np.array([[0.0, 0.5, 0.0]])


def lagging():
    mission = paper("stationary", num_robots=3)
    radio = radio_of(mission)
    law = PowerLaw(np.full(3, radio.received_at_1_m_mw))
    rule = Reception(noise_mw=radio.noise_mw, threshold=radio.threshold)
    made = Lagging(ComposedChannel(law, rule), 0.0, 0.0)
    made.start(3, [np.random.default_rng(0)])
    return made


def play(channel, buffers, recipient, now):
    position_m = np.array([[[0.0, 0.0], [10.0, 0.0], [20.0, 0.0]]])
    states = RobotStates(position_m=position_m, velocity_mps=np.zeros((1, 3, 2)))
    turn = settled(states, np.array([recipient]))
    return window(buffers, *turn, channel, np.array([now]), UnderWay())


def test_a_late_request_is_not_answered_and_carries_what_was_known_when_it_was_sent():
    channel, buffers = lagging(), empty_buffers(1, 3)
    first, second = play(channel, buffers, [A, C, C], 0.0)  # B asks C
    assert first.heard[0].tolist() == [A, B, C]
    assert second.recipient[0].tolist() == [A, B, C]  # nobody answers
    assert second.heard[0].tolist() == [B, B, B]
    # It was sent in the slot that ended at 0.5, and is decoded at 1.
    np.testing.assert_array_equal(buffers.timestamp[0], [[1, 0.5, 0], [0, 1, 0], [0, 0.5, 1]])


def test_a_punctual_request_is_answered_by_a_robot_whose_clock_lags():
    channel, buffers = lagging(), empty_buffers(1, 3)
    first, second = play(channel, buffers, [B, B, C], 0.0)  # A asks B, which answers late
    assert first.heard[0].tolist() == [A, A, A]
    assert second.recipient[0].tolist() == [A, A, C]
    first, _ = play(channel, buffers, [A, B, C], 1.0)
    assert first.heard[0].tolist() == [B, B, B]
    assert buffers.timestamp[0, A, B] == 1.0


def test_without_offset_and_drift_the_channel_is_the_papers():
    mission = paper(clock_offset_s=0.0, clock_drift_ppm=0.0)
    assert mission_radio(mission).channel == radio_of(mission)
