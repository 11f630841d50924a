"""The window with late packets by hand, and equal to the readable one where none is late.

Windows of late requests and late answers stand in `tests/radio/test_asynchronous.py`.
"""

import numpy as np
from turns import settled

from swarm_mj.mission import paper
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol import asynchronous_window, window
from swarm_mj.protocol.buffers import BROADCAST, empty_buffers
from swarm_mj.radio.asynchronous import AsynchronousChannel
from swarm_mj.radio.composed import ComposedChannel, Reception
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.radio.power_law import PowerLaw

A, B, C = range(3)


class Lagging(AsynchronousChannel):
    """Clocks by hand: how far each robot's slots are behind those of the earliest."""

    by_hand = np.zeros(1)

    def lag(self, slot):  # noqa: ARG002
        return self.by_hand[np.newaxis]


def composed(num_robots):
    """The paper's radio, by the channel that asynchronous clocks build on."""
    radio = radio_of(paper("stationary", num_robots=num_robots))
    rule = Reception(noise_mw=radio.noise_mw, threshold=radio.threshold)
    made = ComposedChannel(PowerLaw(np.full(num_robots, radio.received_at_1_m_mw)), rule)
    made.start(num_robots, [np.random.default_rng(0)])
    return made


def lagging(*lag):
    made = Lagging(composed(len(lag)), 0.0, 0.0)
    made.start(len(lag), [np.random.default_rng(0)])
    made.by_hand = np.array(lag)
    return made


def in_a_row(num_robots, **others):
    position_m = np.zeros((1, num_robots, 2))
    position_m[0, :, 0] = 10.0 * np.arange(num_robots)
    return RobotStates(position_m=position_m, velocity_mps=np.zeros_like(position_m), **others)


def test_a_late_broadcast_holds_what_was_known_before_the_slot_in_which_it_arrives():
    """B lags by half a slot: what it tells at 0.5 arrives at 1.0, when it knows itself of 1.0."""
    buffers, channel, states = empty_buffers(1, 3), lagging(0.0, 0.5, 0.0), in_a_row(3)
    recipient = np.array([[A, BROADCAST, C]])
    first = asynchronous_window.broadcast(buffers, states, recipient, channel, np.zeros(1))
    assert first.heard.tolist() == [[A, B, C]]
    assert buffers.timestamp[0].tolist() == [[0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.5]]
    silence, now = np.array([[A, B, C]]), np.array([0.5])
    second = asynchronous_window.broadcast(buffers, states, silence, channel, now)
    assert second.heard.tolist() == [[B, B, B]]
    assert buffers.timestamp[0].tolist() == [[1.0, 0.5, 0], [0, 1.0, 0], [0, 0.5, 1.0]]


def test_a_robot_notes_its_attempt_when_it_sends_and_not_when_the_packet_arrives():
    buffers, channel = empty_buffers(1, 3), lagging(0.0, 0.5, 0.0)
    recipient = np.array([[A, C, C]])
    turn = settled(in_a_row(3), recipient)
    _, response = asynchronous_window.window(buffers, *turn, channel, np.zeros(1))
    assert response.recipient.tolist() == [[A, B, C]]  # C decodes it too late to answer
    assert buffers.last_attempt[0].tolist() == [[0, 0, 0], [0, 0, 0.5], [0, 0, 0]]


def test_where_no_packet_is_late_it_is_the_readable_window():
    rng, now, num_decoded = np.random.default_rng(0), np.zeros(1), 0
    ours, theirs = empty_buffers(1, 6), empty_buffers(1, 6)
    asynchronous, synchronous = lagging(*np.zeros(6)), composed(6)
    for _ in range(20):
        states = in_a_row(6, is_active=rng.random((1, 6)) < 0.8)
        recipient = np.where(rng.random((1, 6)) < 0.3, rng.integers(-1, 6, (1, 6)), np.arange(6))
        turn = settled(states, recipient)
        mine = asynchronous_window.window(ours, *turn, asynchronous, now)
        others = window.window(theirs, *turn, synchronous, now)
        now = now + 1.0
        mine += (asynchronous_window.broadcast(ours, states, recipient, asynchronous, now),)
        others += (window.broadcast(theirs, states, recipient, synchronous, now),)
        now = now + 0.5
        for phase, other in zip(mine, others, strict=True):
            np.testing.assert_array_equal(phase.recipient, other.recipient)
            np.testing.assert_array_equal(phase.heard, other.heard)
            num_decoded += np.sum(phase.heard != np.arange(6))
        for name, known in vars(ours).items():
            np.testing.assert_array_equal(known, vars(theirs)[name])
    assert num_decoded > 0
