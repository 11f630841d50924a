"""The protocol against Fig. 1, hand examples, and Alg. 1 played with dictionaries."""

from dataclasses import replace

import numpy as np
import pytest
from channels import to_everyone, to_nobody, to_the_addressee, unreliable
from hypothesis import given, settings
from hypothesis import strategies as st
from turns import settled

from swarm_mj.mission import paper
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import BROADCAST, empty_buffers, merge, observe_self, record_attempt
from swarm_mj.protocol.talk import talk_over
from swarm_mj.protocol.window import LocalViews, broadcast, channel_at, window
from swarm_mj.protocol.window_protocols import DoubleBroadcast, RequestResponse
from swarm_mj.simulation.swarm import Swarm

seeds = st.integers(0, 2**32 - 1)


def at(position_m, velocity_mps):
    return RobotStates(position_m=position_m, velocity_mps=velocity_mps)


def standing(num_robots, num_missions=1):
    nothing = np.zeros((num_missions, num_robots, 2))
    return at(nothing, nothing)


def some_mission(seed, num_windows, num_robots, num_missions):
    """RobotStates and recipients of every window; about half the robots stay silent."""
    rng = np.random.default_rng(seed)
    states, recipients = [], []
    for _ in range(num_windows):
        states.append(at(*rng.normal(size=(2, num_missions, num_robots, 2))))
        anybody = rng.integers(0, num_robots, (num_missions, num_robots))
        silent = rng.random((num_missions, num_robots)) < 0.5
        recipients.append(np.where(silent, np.arange(num_robots), anybody))
    return states, recipients


class Robot:
    """One robot of Alg. 1, its tables as dictionaries: T, M, P and L of Fig. 1."""

    def __init__(self, name):
        self.name = name
        self.news = {}  # of whom -> (T, M, P)
        self.last_attempt = {}

    def observe(self, state, t):
        self.news[self.name] = (t, state, None)

    def take(self, sender_name, packet):
        for k, (t, state, parent) in packet.items():
            if k not in self.news or self.news[k][0] < t:
                self.news[k] = (t, state, self.name if k == sender_name else parent)


def speak(robots, addressed, heard):
    """All packets are written, then everyone reads the one it decoded."""
    packets = {i: dict(robots[i].news) for i in addressed}
    for j, i in heard.items():
        robots[j].take(i, packets[i])


def alg1(robots, states, addressed, channel, t):
    """One communication window, after the listing of Alg. 1 with Δt of half a window."""
    t += 0.5
    for robot in robots:
        robot.observe(states[robot.name], t)
    for i, j in addressed.items():
        robots[i].last_attempt[j] = t
    heard = channel(addressed)
    speak(robots, addressed, heard)
    t += 0.5
    for robot in robots:
        robot.observe(states[robot.name], t)
    answers = {j: i for j, i in heard.items() if addressed[i] == j}
    speak(robots, answers, channel(answers))
    return answers


def as_dict_channel(channel, num_robots):
    """The same channel for {sender: recipient}, returning {receiver: sender}."""

    def dict_channel(addressed):
        recipient = np.array([[addressed.get(i, i) for i in range(num_robots)]])
        heard = channel(None, recipient)[0].tolist()
        return {j: i for j, i in enumerate(heard) if i != j}

    return dict_channel


def assert_same_knowledge(robots, buffers):
    for i, robot in enumerate(robots):
        for k in range(len(robots)):
            t, state, parent = robot.news.get(k, (0.0, (0.0, 0.0, 0.0, 0.0), None))
            assert buffers.timestamp[0, i, k] == t
            assert (*buffers.position_m[0, i, k], *buffers.velocity_mps[0, i, k]) == state
            assert buffers.parent[0, i, k] == (-1 if parent is None else parent)
            assert buffers.last_attempt[0, i, k] == robot.last_attempt.get(k, 0.0)


def test_fig1_four_rounds_give_robot_0_the_papers_table():
    rounds = [{0: 4, 2: 1}, {1: 0, 2: 3}, {0: 1, 4: 3}, {3: 0}]
    buffers, states = empty_buffers(1, 5), standing(5)
    for t, packets in enumerate(rounds, start=1):
        now = np.array([float(t)])
        recipient = np.array([[packets.get(i, i) for i in range(5)]])
        observe_self(buffers, states, now)
        record_attempt(buffers, recipient, now)
        merge(buffers, to_the_addressee(None, recipient))
    assert buffers.timestamp[0, 0].tolist() == [4, 2, 2, 4, 3]
    assert buffers.parent[0, 0].tolist() == [-1, 0, 3, 0, 3]
    assert buffers.last_attempt[0, 0].tolist() == [0, 3, 0, 0, 1]


@given(seed=seeds, num_robots=st.integers(2, 6), senders_listen=st.booleans())
@settings(max_examples=100)
def test_alg1_windows_as_played_with_dictionaries(seed, num_robots, senders_listen):
    num_windows = 8
    course, recipients = some_mission(seed, num_windows, num_robots, 1)
    channel = unreliable(seed, senders_listen=senders_listen)
    twin = as_dict_channel(unreliable(seed, senders_listen=senders_listen), num_robots)
    buffers, robots = empty_buffers(1, num_robots), [Robot(i) for i in range(num_robots)]
    for t in range(num_windows):
        body, recipient = course[t], recipients[t]
        _, response = window(buffers, *settled(body, recipient), channel, np.array([float(t)]))
        states = np.concatenate([body.position_m[0], body.velocity_mps[0]], axis=1).tolist()
        states = dict(enumerate(map(tuple, states)))
        addressed = {i: j for i, j in enumerate(recipient[0].tolist()) if i != j}
        answers = alg1(robots, states, addressed, twin, float(t))
        assert response.recipient[0].tolist() == [answers.get(j, j) for j in range(num_robots)]
        assert_same_knowledge(robots, buffers)


def test_alg1_silence_counts_as_attempt_when_told_so():
    buffers = empty_buffers(1, 2)
    recipient, now = np.array([[1, 1]]), np.array([0.0])
    window(buffers, *settled(standing(2), recipient), to_nobody, now, silence_is_attempt=True)
    assert buffers.last_attempt[0].tolist() == [[0.0, 0.5], [0.0, 0.5]]
    broadcast(buffers, standing(2), recipient, to_nobody, now + 2.5, silence_is_attempt=True)
    assert buffers.last_attempt[0].tolist() == [[0.0, 3.0], [0.0, 3.0]]


def play_once(protocol, buffers, recipients, num_robots):
    """One window from t = 0, in which a robot's x is how often it has moved."""
    moves, asked = [], []

    def move():
        moves.append(len(asked))  # how many decisions came before
        position_m = np.zeros((1, num_robots, 2))
        position_m[..., 0] = len(moves)
        return at(position_m, np.zeros((1, num_robots, 2)))

    def decide(phases):
        asked.append(phases)
        return np.array([recipients[len(asked) - 1]])

    phases = protocol(buffers, decide, move, talk_over(to_everyone, buffers), np.zeros(1))
    return phases, asked, moves


def test_alg1_robots_decide_once_then_move_and_whoever_was_addressed_answers():
    buffers = empty_buffers(1, 3)
    phases, asked, moves = play_once(RequestResponse(), buffers, [[1, 1, 2]], 3)
    assert not RequestResponse.is_broadcast
    assert (asked, moves) == ([()], [1])
    assert [phase.recipient[0].tolist() for phase in phases] == [[1, 1, 2], [0, 0, 2]]
    assert buffers.position_m[0, 2, :, 0].tolist() == [1.0, 1.0, 1.0]


@pytest.mark.parametrize(("moves_each_slot", "moved_after"), [(False, [1]), (True, [1, 2])])
def test_iv_c_robots_decide_before_each_broadcast_and_nobody_answers(moves_each_slot, moved_after):
    buffers = empty_buffers(1, 3)
    protocol = DoubleBroadcast(moves_each_slot=moves_each_slot)
    recipients = [[BROADCAST, 1, 2], [0, BROADCAST, 2]]
    phases, asked, moves = play_once(protocol, buffers, recipients, 3)
    assert DoubleBroadcast.is_broadcast
    assert asked == [(), phases[:1]]  # the second decision knows the first slot
    assert moves == moved_after
    assert [phase.recipient[0].tolist() for phase in phases] == recipients
    assert buffers.timestamp[0].tolist() == [[1.0, 1.0, 0.0], [0.5, 1.0, 0.0], [0.5, 1.0, 1.0]]
    assert not np.any(buffers.last_attempt)  # a broadcast addresses nobody
    where_1_was = 2.0 if moves_each_slot else 1.0
    assert buffers.position_m[0, 2, :2, 0].tolist() == [1.0, where_1_was]


def test_by_the_authors_half_duplex_rule_a_broadcast_needs_an_addressee():
    """The next identity, but where the policy names one."""
    protocol = DoubleBroadcast(needs_addressees=True)
    recipients = [[BROADCAST, 1, BROADCAST], [2, 1, 2]]
    phases, *_ = play_once(protocol, empty_buffers(1, 3), recipients, 3)
    assert [phase.recipient[0].tolist() for phase in phases] == [[1, 1, 0], [2, 1, 2]]


def test_inactive_robots_neither_send_nor_decode_nor_observe():
    """Robot 2 would answer 0, and 1 decodes 0 alone."""
    buffers = empty_buffers(1, 3)
    states = replace(standing(3), is_active=np.array([[True, True, False]]))
    turn = settled(states, np.array([[2, 1, 1]]))
    request, response = window(buffers, *turn, to_everyone, np.zeros(1))
    assert request.recipient.tolist() == [[2, 1, 2]]
    assert request.heard.tolist() == [[0, 0, 2]]
    assert response.recipient.tolist() == [[0, 1, 2]]
    assert buffers.timestamp[0].tolist() == [[1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 0.0]]
    assert buffers.last_attempt[0].tolist() == [[0.0, 0.0, 0.5], [0.0] * 3, [0.0] * 3]


def test_the_channel_gets_the_true_positions_and_everyones_recipients():
    asked = []

    def channel(position_m, recipient):
        asked.append((position_m.copy(), recipient.copy()))
        return to_the_addressee(position_m, recipient)

    states, recipients = some_mission(0, 1, 4, 2)
    turn = settled(states[0], recipients[0])
    first, second = window(empty_buffers(2, 4), *turn, channel, np.zeros(2))
    assert len(asked) == 2
    for (position_m, recipient), phase in zip(asked, (first, second), strict=True):
        assert (position_m == states[0].position_m).all()
        assert (recipient == phase.recipient).all()
        assert (phase.heard == to_the_addressee(None, recipient)).all()
    assert (asked[0][1] == recipients[0]).all()


class Schedule:
    """A channel that is told the slot; in odd ones nobody hears anybody."""

    def __init__(self):
        self.asked = []

    def at(self, slot, mission):
        self.asked.append((slot.tolist(), mission.tolist()))
        return to_nobody if slot[0] % 2 else to_everyone


def test_a_varying_channel_is_asked_for_each_slot_of_a_window():
    channel, buffers = Schedule(), empty_buffers(2, 3)
    recipient = np.array([[-1, 1, 2], [-1, 1, 2]])
    turn = settled(standing(3, 2), recipient)
    first, second = window(buffers, *turn, channel, np.array([4.0, 4.0]))
    assert channel.asked == [([8, 8], [0, 1]), ([9, 9], [0, 1])]
    assert first.heard.tolist() == [[0, 0, 0]] * 2
    assert second.heard.tolist() == [[0, 1, 2]] * 2


def test_rows_of_a_varying_channel_may_be_any_missions():
    channel = Schedule()
    channel_at(channel, np.array([0.5, 0.5, 1.0]), np.array([1, 0, 1]))
    assert channel.asked == [([0, 0, 1], [1, 0, 1])]


def views_of(num_missions, num_robots):
    buffers = empty_buffers(num_missions, num_robots)
    return LocalViews(buffers=buffers, now=np.zeros(num_missions), phases=())


@pytest.mark.parametrize(("num_missions", "num_robots"), [(2, 8), (3, 8), (2, 5)])
def test_alg1_silence_is_addressing_oneself(num_missions, num_robots):
    views = views_of(num_missions, num_robots)
    assert views.num_robots == num_robots
    np.testing.assert_array_equal(views.silence, [range(num_robots)] * num_missions)


def test_silence_cannot_be_written():
    """All views of a shape share it, so a policy that wrote it would silence or wake others."""
    with pytest.raises(ValueError, match="read-only"):
        views_of(2, 3).silence[0, 1] = 0
    np.testing.assert_array_equal(views_of(2, 3).silence, [[0, 1, 2]] * 2)


def test_a_swarms_view_changes_with_the_next_window_and_not_by_hand():
    swarm = Swarm(paper("stationary", num_robots=3), [1])
    views = swarm.views
    swarm.step_with_recipients(views.silence)
    np.testing.assert_array_equal(np.diagonal(views.buffers.timestamp[0]), [1.0, 1.0, 1.0])
    with pytest.raises(ValueError, match="read-only"):
        views.buffers.timestamp[0, 0, 1] = 9.0
