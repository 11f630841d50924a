"""The window with late packets by hand, and equal to the readable one where none is late.

Windows of late requests and late answers stand in `tests/radio/test_asynchronous.py`.
"""

import numpy as np
from turns import settled

from swarm_mj.mission import paper
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol import asynchronous_window, window
from swarm_mj.protocol.asynchronous_window import UnderWay
from swarm_mj.protocol.buffers import BROADCAST, empty_buffers
from swarm_mj.radio.asynchronous import AsynchronousChannel
from swarm_mj.radio.composed import ComposedChannel
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.radio.power_law import PowerLaw
from swarm_mj.radio.reception import Reception

A, B, C = range(3)


class Lagging(AsynchronousChannel):
    """Clocks by hand: how far each robot's slots are behind those of the earliest."""

    by_hand = np.zeros(1)

    def lag(self, slot):  # noqa: ARG002
        return self.by_hand[np.newaxis]


def composed(num_robots, **others):
    """The paper's radio, by the channel that asynchronous clocks build on."""
    radio = radio_of(paper("stationary", num_robots=num_robots))
    rule = Reception(noise_mw=radio.noise_mw, threshold=radio.threshold, **others)
    made = ComposedChannel(PowerLaw(np.full(num_robots, radio.received_at_1_m_mw)), rule)
    made.start(num_robots, [np.random.default_rng(0)])
    return made


def lagging(*lag, **others):
    made = Lagging(composed(len(lag), **others), 0.0, 0.0)
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
    under_way = UnderWay()
    recipient = np.array([[A, BROADCAST, C]])
    first = asynchronous_window.broadcast(
        buffers, states, recipient, channel, np.zeros(1), under_way
    )
    assert first.heard.tolist() == [[A, B, C]]
    assert buffers.timestamp[0].tolist() == [[0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.5]]
    silence, now = np.array([[A, B, C]]), np.array([0.5])
    second = asynchronous_window.broadcast(buffers, states, silence, channel, now, under_way)
    assert second.heard.tolist() == [[B, B, B]]
    assert buffers.timestamp[0].tolist() == [[1.0, 0.5, 0], [0, 1.0, 0], [0, 0.5, 1.0]]


def test_a_robot_notes_its_attempt_when_it_sends_and_not_when_the_packet_arrives():
    buffers, channel = empty_buffers(1, 3), lagging(0.0, 0.5, 0.0)
    recipient = np.array([[A, C, C]])
    turn = settled(in_a_row(3), recipient)
    _, response = asynchronous_window.window(buffers, *turn, channel, np.zeros(1), UnderWay())
    assert response.recipient.tolist() == [[A, B, C]]  # C decodes it too late to answer
    assert buffers.last_attempt[0].tolist() == [[0, 0, 0], [0, 0, 0.5], [0, 0, 0]]


def test_where_no_packet_is_late_it_is_the_readable_window():
    rng, now, num_decoded = np.random.default_rng(0), np.zeros(1), 0
    ours, theirs = empty_buffers(1, 6), empty_buffers(1, 6)
    asynchronous, synchronous, under_way = lagging(*np.zeros(6)), composed(6), UnderWay()
    for _ in range(20):
        states = in_a_row(6, is_active=rng.random((1, 6)) < 0.8)
        recipient = np.where(rng.random((1, 6)) < 0.3, rng.integers(-1, 6, (1, 6)), np.arange(6))
        turn = settled(states, recipient)
        mine = asynchronous_window.window(ours, *turn, asynchronous, now, under_way)
        others = window.window(theirs, *turn, synchronous, now)
        now = now + 1.0
        mine += (
            asynchronous_window.broadcast(ours, states, recipient, asynchronous, now, under_way),
        )
        others += (window.broadcast(theirs, states, recipient, synchronous, now),)
        now = now + 0.5
        for phase, other in zip(mine, others, strict=True):
            np.testing.assert_array_equal(phase.recipient, other.recipient)
            np.testing.assert_array_equal(phase.heard, other.heard)
            num_decoded += np.sum(phase.heard != np.arange(6))
        for name, known in vars(ours).items():
            np.testing.assert_array_equal(known, vars(theirs)[name])
    assert num_decoded > 0


def talked(lags, *slots):
    """What robots 10 m apart in a row know of each other after slots under the authors' rule."""
    buffers, states, under_way = empty_buffers(1, len(lags)), in_a_row(len(lags)), UnderWay()
    channel = lagging(*lags, recipient_hears_while_sending=True)
    for n, recipient in enumerate(slots):
        now = np.array([0.5 * n])
        phase = asynchronous_window.broadcast(
            buffers, states, np.array([recipient]), channel, now, under_way
        )
    return phase.heard[0].tolist(), buffers


def test_a_late_packet_holds_nothing_that_its_sender_decoded_while_it_sent():
    """B sends from 0.3 to 1.1 and hears A from 0.0 to 0.8; C hears B alone, and so not of A."""
    heard, buffers = talked((0.0, 0.3, 0.0), [B, A, C], [A, B, C])
    assert heard == [B, B, B]
    assert buffers.timestamp[0].tolist() == [[1.0, 0.5, 0], [0.5, 1.0, 0], [0, 0.5, 1.0]]
    assert buffers.parent[0].tolist() == [[-1, A, -1], [B, -1, -1], [-1, C, -1]]
    assert buffers.position_m[0, C, :, 0].tolist() == [0.0, 10.0, 20.0]


def test_a_late_packet_holds_what_its_sender_decoded_before_it_began():
    """B sends from 0.9 to 1.7, so it knew of A by then; C hears of A by B."""
    heard, buffers = talked((0.0, 0.9, 0.0), [B, A, C], [A, B, C])
    assert heard == [B, B, B]
    assert buffers.timestamp[0, C].tolist() == [0.5, 0.5, 1.0]


def test_a_punctual_packet_holds_nothing_of_a_late_one_that_ends_after_it_began():
    """A's first packet ends at 1.3, when B's, from 1.0 to 1.8, is on its way to C."""
    heard, buffers = talked((0.5, 0.0, 0.0, 0.0), [B, B, C, 3], [A, C, C, 3])
    assert heard[B] == A
    assert heard[C] == B
    assert buffers.timestamp[0, B].tolist() == [0.5, 1.0, 0, 0]
    assert buffers.timestamp[0, C].tolist() == [0, 1.0, 1.0, 0]
