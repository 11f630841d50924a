"""What robots remember of packets, against loops over the packets that the simulator sent."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mixed_missions import NUM_ROBOTS, SEEDS, random_recipients

from swarm_mj.mission import paper, reference
from swarm_mj.policies.gnn.packet_memory import (
    empty_memory,
    log_age,
    remember,
    write_log_ages,
)
from swarm_mj.protocol.window import Phase
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.simulation.swarm import Swarm

ARRAYS = ("heard", "addressed_by", "sent", "said")


class Wire:
    """The mission's radio, which keeps every packet: the buffers at the moment of sending."""

    def __init__(self, mission):
        self._radio = radio_of(mission)
        self.packets = []  # (T of every sender, recipients, whom everyone decoded), phase by phase
        self.swarm = Swarm(mission, SEEDS, channel=self)

    def __call__(self, position_m, recipient):
        heard = self._radio(position_m, recipient)
        self.packets.append((self.swarm.buffers.timestamp.copy(), recipient.copy(), heard.copy()))
        return heard


class Diary:
    """One robot's memory: it is handed what it sent and what it decoded, and nothing else."""

    def __init__(self, num_robots):
        self.heard, self.addressed_by, self.said = ([0.0] * num_robots for _ in range(3))
        self.neighbour = [[0.0] * num_robots for _ in range(num_robots)]
        self.sent = 0.0

    def send(self, packet, now):
        self.sent, self.said = now, packet

    def hear(self, sender, packet, now, *, is_for_me):
        self.heard[sender], self.neighbour[sender] = now, packet
        if is_for_me:
            self.addressed_by[sender] = now


def neighbours(memory):
    """T in the last packet of each robot that each one decoded [mission, receiver, sender]."""
    missions, receivers, senders = np.indices(memory.decoded.shape)
    packets = memory.packet[missions, senders, memory.decoded]
    packets[receivers == senders] = 0.0  # nobody decodes itself, so nothing is kept for that
    return packets


def read_packets(diaries, packets, now):
    """A window's two phases, half a window each: who spoke first, then who answered."""
    for phase, (timestamp, recipient, heard) in enumerate(packets):
        time = now + 0.5 * (phase + 1)
        for b, team in enumerate(diaries):
            for i, diary in enumerate(team):
                if phase == 0 and recipient[b, i] != i:
                    diary.send(timestamp[b, i].tolist(), time)
                k = int(heard[b, i])
                if k != i:
                    packet = timestamp[b, k].tolist()
                    diary.hear(k, packet, time, is_for_me=bool(recipient[b, k] == i))


@pytest.mark.parametrize("make", [paper, reference])
@pytest.mark.parametrize("task", ["stationary", "random-walk"])
def test_alg1_memory_is_what_was_sent_and_decoded(make, task):
    mission = make(task, num_robots=NUM_ROBOTS)
    wire = Wire(mission)
    memory = empty_memory(len(SEEDS), NUM_ROBOTS)
    diaries = [[Diary(NUM_ROBOTS) for _ in range(NUM_ROBOTS)] for _ in SEEDS]
    remember(memory, wire.swarm.views)
    for now, recipient in enumerate(random_recipients(seed=0)):
        wire.swarm.step_with_recipients(recipient)
        remember(memory, wire.swarm.views)
        read_packets(diaries, wire.packets[-2:], float(now))
        for name in ARRAYS:
            expected = [[getattr(diary, name) for diary in team] for team in diaries]
            np.testing.assert_array_equal(getattr(memory, name), expected, err_msg=f"{now} {name}")
        expected = [[diary.neighbour for diary in team] for team in diaries]
        np.testing.assert_array_equal(neighbours(memory), expected, err_msg=f"{now}")
    for name in ("heard", "addressed_by"):
        assert np.mean(getattr(memory, name) > 0.0) > 0.2


def test_every_robot_may_remember_another_packet():
    """Robot 0 speaks window after window, and each time another robot decodes it, twice round."""
    num_robots = 5
    memory = empty_memory(1, num_robots)
    views = Swarm(paper("stationary", num_robots=num_robots), [0]).views
    silent = np.arange(num_robots)[np.newaxis]
    last = {}
    for now in range(1, 9):
        listener = 1 + now % (num_robots - 1)
        heard = silent.copy()
        heard[0, listener] = 0
        phases = (Phase(recipient=silent, heard=heard), Phase(recipient=silent, heard=silent))
        remember(memory, replace(views, now=np.array([float(now)]), phases=phases))
        last[listener] = now - 0.5  # when robot 0 observed itself
    for robot, when in last.items():
        assert neighbours(memory)[0, robot, 0, 0] == when


@pytest.mark.parametrize("age", [0.0, 0.5, 1.0, 17.5, 499.5, 0.3, 499.9, 500.0, 2_000.5])
def test_ages_count_by_their_logarithm_whether_they_are_looked_up_or_not(age):
    expected = pytest.approx(min(1.0, math.log(1 + age) / math.log(501)))
    assert log_age(3_000.0, 3_000.0 - age) == expected
    assert log_age(age, 0.0) == 1.0  # never
    assert log_age(age, 0.0, True) == expected  # granted at the start


@pytest.mark.parametrize("is_granted", [False, True])
@pytest.mark.parametrize("others", [(), (0.3,), (-0.5,), (499.9,)])
def test_ages_of_many_are_those_of_each(others, is_granted):
    """Of whole and half windows, the longest and never included, and of `others` between them."""
    now = 700.0
    then = np.array([0.0, now, *(now - age for age in (0.5, 17.5, 499.5, 500.0, 600.0, *others))])
    ages = np.empty(len(then), dtype=np.float32)
    write_log_ages(now, then, is_granted, ages)
    expected = [log_age(now, each, is_granted) for each in then.tolist()]
    np.testing.assert_array_equal(ages, np.array(expected, dtype=np.float32))
