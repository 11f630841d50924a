"""A robot's credit is what its team would not have gained in a window without it."""

import copy
from types import SimpleNamespace

import numpy as np
import pytest
from channels import to_the_addressee
from hypothesis import given
from hypothesis import strategies as st

from swarm_mj.envs.credit import credits_of, gain, snapshot_channel
from swarm_mj.mission import PRESETS, paper, reference
from swarm_mj.protocol.window import window
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.simulation.swarm import Swarm


def random_recipients(rng, shape, share):
    """A share of all speaks, to anyone."""
    silence = np.broadcast_to(np.arange(shape[1]), shape)
    return np.where(rng.random(shape) < share, rng.integers(0, shape[1], shape), silence)


def total_after(swarm, buffers, recipient, now):
    """The sum of a mission's T after a window, by the public protocol, on a copy."""
    replayed = copy.deepcopy(buffers)
    window(replayed, swarm.states, recipient, swarm.channel, now)
    return replayed.timestamp.sum(axis=(1, 2))


def credits_by_replay(swarm, buffers, recipient, now):
    """Every robot silenced in turn, all else as it was."""
    together = total_after(swarm, buffers, recipient, now)
    credit = np.zeros(recipient.shape)
    for i in range(recipient.shape[1]):
        without = recipient.copy()
        without[:, i] = i
        credit[:, i] = together - total_after(swarm, buffers, without, now)
    return credit


@given(
    seed=st.integers(0, 2**32 - 1),
    preset=st.sampled_from([paper, reference]),
    task=st.sampled_from(["stationary", "random-walk", "flocking"]),
    share=st.floats(0.0, 0.6),
    num_robots=st.integers(2, 9),
)
def test_credits_are_those_of_a_replay_without_each_robot(seed, preset, task, share, num_robots):
    """In any state that random talk leads to, under both presets' radios."""
    rng = np.random.default_rng(seed)
    swarm = Swarm(preset(task, num_robots=num_robots, range_ratio=0.5), [seed, seed + 1])
    shape = (2, num_robots)
    for _ in range(rng.integers(1, 12)):
        buffers, now = copy.deepcopy(swarm.buffers), swarm.now
        recipient = random_recipients(rng, shape, share)
        swarm.step_with_recipients(recipient)
    found = credits_of(buffers.timestamp, swarm.states.position_m, recipient, swarm.channel, now)
    expected = credits_by_replay(swarm, buffers, recipient, now)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert np.all(found[recipient == np.arange(num_robots)] == 0.0)


def test_a_window_replayed_for_credit_meets_the_same_fades_and_losses():
    """Every robot silenced in turn, among obstacles, under fading, shadowing, bursts, erasures."""
    losses = {"erasure": 0.2, "burst_begin": 0.05, "fading": "rayleigh", "num_robots": 8}
    swarm = Swarm(PRESETS["urban"]("stationary", **losses), [1, 2])
    rng, num_credited = np.random.default_rng(4), 0
    for _ in range(12):
        buffers, now = copy.deepcopy(swarm.buffers), swarm.now
        recipient = random_recipients(rng, (2, 8), 0.3)
        swarm.step_with_recipients(recipient)
        position_m = swarm.states.position_m
        found = credits_of(buffers.timestamp, position_m, recipient, swarm.channel, now)
        expected = credits_by_replay(swarm, buffers, recipient, now)
        np.testing.assert_allclose(found, expected, atol=1e-9)
        num_credited += np.sum(found != 0.0)
    assert num_credited > 10


def standing(position_m):
    """One mission's robots at rest, and what the lone radio of the tests reaches: 100 m."""
    channel = FreeSpaceRadio(power_mw=1.0, noise_mw=1e-9, threshold=1.26, frequency_hz=2.4e9)
    states = np.array([position_m], dtype=float)
    return states, channel


def test_who_destroys_a_packet_pays_for_it():
    """Robots 0 and 1 are as far from robot 2, so that it decodes neither of the two."""
    position_m, channel = standing([[-20.0, 0.0], [20.0, 0.0], [0.0, 0.0]])
    timestamp, now = np.full((1, 3, 3), 4.0), np.array([10.0])
    both, one = np.array([[2, 2, 2]]), np.array([[2, 1, 2]])
    gained = gain(timestamp, position_m, one, channel, now, np.array([0]))
    assert gained[0] > 0.0
    credit = credits_of(timestamp, position_m, both, channel, now)
    np.testing.assert_allclose(credit, [[-gained[0], -gained[0], 0.0]])
    credit = credits_of(timestamp, position_m, one, channel, now)
    np.testing.assert_allclose(credit, [[gained[0], 0.0, 0.0]])


def test_a_gain_is_the_news_of_the_packet_and_of_its_answer():
    """By hand: 0 tells 1 at 10.5 of itself and of 2; 1 answers at 11 with itself, and of 3."""
    timestamp = np.array(
        [[[9.0, 4.0, 7.0, 1.0], [3.0, 9.0, 2.0, 6.0], [0.0] * 4, [0.0] * 4]],
    )  # fmt: skip
    to_one = np.array([[1, 1, 2, 3]])
    position_m = np.zeros((1, 4, 2))
    gained = gain(timestamp, position_m, to_one, to_the_addressee, np.array([10.0]), np.array([0]))
    told = (10.5 - 3.0) + (7.0 - 2.0)
    answered = (11.0 - 4.0) + (6.0 - 1.0)
    assert gained[0] == pytest.approx(told + answered)


def test_missions_side_by_side_do_not_mix():
    rng = np.random.default_rng(3)
    swarm = Swarm(paper("random-walk", num_robots=6, range_ratio=0.5), [1, 2, 3])
    for _ in range(6):
        before, now = swarm.buffers.timestamp.copy(), swarm.now
        recipient = random_recipients(rng, (3, 6), 0.4)
        swarm.step_with_recipients(recipient)
    position_m = swarm.states.position_m
    together = credits_of(before, position_m, recipient, swarm.channel, now)
    for b in range(3):
        rows = slice(b, b + 1)
        alone = credits_of(
            before[rows], position_m[rows], recipient[rows], swarm.channel, now[rows]
        )
        np.testing.assert_array_equal(alone, together[rows])


def test_nothing_given_is_changed():
    swarm = Swarm(paper("stationary", num_robots=5, range_ratio=0.5), [1])
    given_ = (swarm.buffers.timestamp, swarm.states.position_m, np.array([[1, 2, 2, 2, 3]]))
    before = copy.deepcopy(given_)
    credits_of(*given_, swarm.channel, swarm.now)
    for after, as_it_was in zip(given_, before, strict=True):
        np.testing.assert_array_equal(after, as_it_was)


class Lossy:
    """A radio that loses three packets of ten; every mission draws for itself."""

    def __init__(self, mission):
        self.radio = radio_of(mission)

    def start(self, num_robots, rngs):
        self.num_robots, self.rngs = num_robots, rngs

    def __call__(self, position_m, recipient):
        draws = np.stack([rng.random(self.num_robots) for rng in self.rngs])
        heard = self.radio(position_m, recipient)
        return np.where(draws < 0.3, np.arange(self.num_robots), heard)


def test_a_channel_that_draws_replays_a_window_with_its_own_numbers():
    rng = np.random.default_rng(4)
    mission = paper("random-walk", num_robots=6, range_ratio=0.6)
    swarm = Swarm(mission, [5, 6, 7], channel=Lossy(mission))
    num_lost = 0
    for _ in range(15):
        buffers, now, before = (
            copy.deepcopy(swarm.buffers),
            swarm.now,
            snapshot_channel(swarm.channel),
        )
        recipient = random_recipients(rng, (3, 6), 0.4)
        swarm.step_with_recipients(recipient)
        found = credits_of(buffers.timestamp, swarm.states.position_m, recipient, before, now)
        replays = SimpleNamespace(states=swarm.states, channel=None)
        total = {}
        for silent in (None, *range(6)):
            replays.channel = copy.deepcopy(before)
            without = recipient.copy()
            if silent is not None:
                without[:, silent] = silent
            total[silent] = total_after(replays, buffers, without, now)
        np.testing.assert_array_equal(total[None], swarm.buffers.timestamp.sum(axis=(1, 2)))
        expected = np.stack([total[None] - total[i] for i in range(6)], axis=1)
        np.testing.assert_allclose(found, expected, atol=1e-9)
        num_lost += np.count_nonzero(found < 0.0)
    assert num_lost > 0  # some packet destroyed another


def test_credits_are_those_of_a_replay_without_each_robot_also_after_robots_have_failed():
    """Only pairs of robots that still work count; those that failed neither send nor answer."""
    rng = np.random.default_rng(5)
    mission = paper(
        "stationary", num_robots=8, range_ratio=0.5, num_windows=16, failure_fraction=0.3
    )
    swarm, num_credited = Swarm(mission, [1, 2]), 0
    for _ in range(16):
        buffers, now = copy.deepcopy(swarm.buffers), swarm.now
        recipient = random_recipients(rng, (2, 8), 0.3)
        swarm.step_with_recipients(recipient)
        states = swarm.states
        if states.is_active is None:
            continue
        counted = states.is_active[:, :, None] & states.is_active[:, None, :]
        total = []
        for i in range(-1, 8):  # -1: nobody is silenced
            without = recipient.copy()
            if i >= 0:
                without[:, i] = i
            replayed = copy.deepcopy(buffers)
            window(replayed, states, without, swarm.channel, now)
            total.append(np.where(counted, replayed.timestamp, 0.0).sum(axis=(1, 2)))
        expected = np.stack([total[0] - each for each in total[1:]], axis=1)
        given_ = (buffers.timestamp, states.position_m, recipient, swarm.channel, now)
        found = credits_of(*given_, states.is_active)
        np.testing.assert_allclose(found, expected, atol=1e-9)
        assert np.all(found[~states.is_active] == 0.0)
        num_credited += np.sum(found != 0.0)
    assert num_credited > 10
