"""A robot's credit is what its team would not have gained in a window without it."""

import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from channels import to_the_addressee
from hypothesis import given, settings
from hypothesis import strategies as st
from turns import settled

from swarm_mj.envs.credit import credits_over, replay_otherwise, snapshot_channel
from swarm_mj.envs.mission_batch import MissionBatch
from swarm_mj.mission import PRESETS, paper, reference
from swarm_mj.protocol.window import window
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.simulation.components import Components


def random_recipients(rng, shape, share):
    """A share of all speaks, to anyone."""
    silence = np.broadcast_to(np.arange(shape[1]), shape)
    return np.where(rng.random(shape) < share, rng.integers(0, shape[1], shape), silence)


def credits_by_replay(swarm, channel, buffers, recipient, considered, now, unknown_age=0.0):
    """Every robot silenced in turn, all else as it was, by the public protocol on copies.

    And those that were silent speak to whom they considered. Only pairs of robots that still work
    count; what is still unknown counts as older.
    """
    on = swarm.states.is_active
    counted = 1.0 if on is None else on[:, :, None] & on[:, None, :]

    def total_after(recipient):
        replayed = copy.deepcopy(buffers)
        window(replayed, *settled(swarm.states, recipient), copy.deepcopy(channel), now)
        return worth(replayed)

    def worth(buffers):
        seen = np.where(buffers.is_known, buffers.timestamp, -unknown_age)
        return (seen * counted).sum(axis=(1, 2))

    together = total_after(recipient)
    np.testing.assert_array_equal(together, worth(swarm.buffers))
    credit = np.zeros(recipient.shape)
    for i in range(recipient.shape[1]):
        without, with_it = recipient.copy(), recipient.copy()
        without[:, i] = i
        with_it[:, i] = considered[:, i]
        credit[:, i] = total_after(with_it) - total_after(without)
    return credit


def assert_rewards_are_those_of_a_replay(
    mission, seeds, num_windows, share, channel=None, unknown_age=0.0, also_considered=0.0
):
    """In each window of random talk; returns all credits.

    A share of the silent considers speech.
    """
    its = {"components": Components(channel=channel), "unknown_age": unknown_age}
    batch = MissionBatch(mission, len(seeds), features="paper", reward="credit", **its)
    batch.restart(seeds)
    credited, rng = [], np.random.default_rng(seeds[0])
    for _ in range(num_windows):
        swarm, now = batch.flown, batch.flown.now
        buffers, before = copy.deepcopy(swarm.buffers), snapshot_channel(swarm.channel)
        recipient = random_recipients(rng, batch.shape, share)
        silent = recipient == np.arange(mission.num_robots)
        others = random_recipients(rng, batch.shape, also_considered)
        considered = np.where(silent, others, recipient)
        if also_considered:
            played = batch.fly_for_credit(recipient, considered)
            found = credits_over([played], horizon=1).credit[0]
        else:
            found = batch.step(recipient) * mission.num_robots**2
        expected = credits_by_replay(
            swarm, before, buffers, recipient, considered, now, unknown_age
        )
        np.testing.assert_allclose(found, expected, atol=1e-9)
        assert np.all(found[considered == np.arange(mission.num_robots)] == 0.0)
        assert np.all(found[~batch.is_active] == 0.0)
        credited.append(found)
    return np.array(credited)


@given(
    seed=st.integers(0, 2**32 - 1),
    preset=st.sampled_from([paper, reference]),
    task=st.sampled_from(["stationary", "random-walk", "flocking"]),
    share=st.floats(0.0, 0.6),
    num_robots=st.integers(2, 9),
    num_windows=st.integers(1, 8),
)
@settings(max_examples=20)
def test_credits_are_those_of_a_replay_without_each_robot(
    seed, preset, task, share, num_robots, num_windows
):
    """In any state that random talk leads to, under both presets' radios."""
    mission = preset(task, num_robots=num_robots, range_ratio=0.5)
    assert_rewards_are_those_of_a_replay(mission, [seed, seed + 1], num_windows, share)


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


WALKING = paper("random-walk", num_robots=6, range_ratio=0.6)
NUMBERS = {"erasure": 0.2, "burst_begin": 0.05, "fading": "rayleigh", "num_robots": 8}
FADED = PRESETS["urban"]("stationary", **NUMBERS)
FAILING = paper("stationary", num_robots=8, range_ratio=0.5, num_windows=16, failure_fraction=0.3)


@pytest.mark.parametrize(
    ("mission", "channel"),
    [(FADED, None), (WALKING, Lossy(WALKING)), (FAILING, None)],
    ids=["fades and losses", "a channel that draws", "robots that fail"],
)
def test_a_window_replayed_for_credit_meets_the_same_world(mission, channel):
    credit = assert_rewards_are_those_of_a_replay(mission, [4, 2, 3], 16, 0.35, channel)
    assert np.count_nonzero(credit) > 10
    assert np.any(credit < 0.0)  # some packet destroyed another


@pytest.mark.parametrize(
    ("mission", "channel"),
    [(WALKING, None), (FADED, None), (WALKING, Lossy(WALKING)), (FAILING, None)],
    ids=["free space", "fades and losses", "a channel that draws", "robots that fail"],
)
def test_a_packet_only_considered_has_the_credit_that_it_would_have_had(mission, channel):
    both = assert_rewards_are_those_of_a_replay(
        mission, [4, 2, 3], 16, 0.2, channel, also_considered=0.5
    )
    sent = assert_rewards_are_those_of_a_replay(mission, [4, 2, 3], 16, 0.2, channel)
    assert np.count_nonzero(both) > 2 * np.count_nonzero(sent)
    assert np.any(both < 0.0)


@pytest.mark.parametrize("mission", [WALKING, FAILING], ids=["walking", "robots that fail"])
def test_unknown_teammates_count_as_older_in_a_credit(mission):
    """By the same replay: whoever is known counts as before."""
    seeds = [4, 2, 3]
    usual = assert_rewards_are_those_of_a_replay(mission, seeds, 16, 0.2)
    older = assert_rewards_are_those_of_a_replay(mission, seeds, 16, 0.2, unknown_age=25.0)
    assert older[:5].sum() > 2.0 * usual[:5].sum()  # first news is worth more
    # News of teammates that the robot knows are worth what they were.
    assert np.sum((usual == older) & (usual != 0.0)) > 10


def test_who_was_known_at_the_start_is_not_unknown():
    mission = paper("random-walk", num_robots=6, range_ratio=0.6, prior_knowledge="start")
    usual = assert_rewards_are_those_of_a_replay(mission, [1, 2], 6, 0.3)
    older = assert_rewards_are_those_of_a_replay(mission, [1, 2], 6, 0.3, unknown_age=25.0)
    np.testing.assert_array_equal(older, usual)
    assert np.any(usual > 0.0)


def standing(position_m):
    """One mission's robots at rest, and what the lone radio of the tests reaches: 100 m."""
    channel = FreeSpaceRadio(power_mw=1.0, noise_mw=1e-9, threshold=1.26, frequency_hz=2.4e9)
    states = np.array([position_m], dtype=float)
    return states, channel


def credits_of(*played, **its):
    """Those of one window alone."""
    return credits_over([replay_otherwise(*played, **its)], horizon=1).credit[0]


def test_who_destroys_a_packet_pays_for_it():
    """Robots 0 and 1 are as far from robot 2, so that it decodes neither of the two."""
    position_m, channel = standing([[-20.0, 0.0], [20.0, 0.0], [0.0, 0.0]])
    timestamp, now = np.full((1, 3, 3), 4.0), np.array([10.0])
    both, one = np.array([[2, 2, 2]]), np.array([[2, 1, 2]])
    alone = credits_of(timestamp, position_m, one, channel, now)
    gained = alone[0, 0]
    assert gained > 0.0
    np.testing.assert_allclose(alone, [[gained, 0.0, 0.0]])
    credit = credits_of(timestamp, position_m, both, channel, now)
    np.testing.assert_allclose(credit, [[-gained, -gained, 0.0]])


def test_a_gain_is_the_news_of_the_packet_and_of_its_answer():
    """By hand: 0 tells 1 at 10.5 of itself and of 2; 1 answers at 11 with itself, and of 3."""
    timestamp = np.array(
        [[[9.0, 4.0, 7.0, 1.0], [3.0, 9.0, 2.0, 6.0], [0.0] * 4, [0.0] * 4]],
    )  # fmt: skip
    to_one = np.array([[1, 1, 2, 3]])
    position_m = np.zeros((1, 4, 2))
    credit = credits_of(timestamp, position_m, to_one, to_the_addressee, np.array([10.0]))
    told = (10.5 - 3.0) + (7.0 - 2.0)
    answered = (11.0 - 4.0) + (6.0 - 1.0)
    assert credit[0, 0] == pytest.approx(told + answered)


# Over a horizon.


def test_news_count_until_they_would_have_come_anyway():
    """By hand: 0 tells 1 of itself at 10.5; then, in the third window, again at 12.5."""
    timestamp = np.full((1, 3, 3), 4.0)
    position_m = np.zeros((1, 3, 2))
    speaks, silent = np.array([[1, 1, 2]]), np.array([[0, 1, 2]])
    windows = []
    for n, recipient in enumerate([speaks, silent, speaks, silent]):
        now = np.array([10.0 + n])
        played = replay_otherwise(timestamp, position_m, recipient, to_the_addressee, now)
        windows.append(played)
        timestamp = played.after
    told = (10.5 - 4.0) + (11.0 - 4.0)  # to 1, and its answer to 0
    for horizon, num_windows in ((1, 1), (2, 2), (3, 2), (4, 2)):
        credit = credits_over(windows, horizon).credit
        # In the third window both hear of each other anyway, whatever was heard in the first.
        assert credit[0, 0, 0] == pytest.approx(num_windows * told), horizon
    again = credits_over(windows, 2).credit[2, 0, 0]
    assert again == pytest.approx(2 * ((12.5 - 10.5) + (13.0 - 11.0)))
    assert np.all(credits_over(windows, 2).credit[:, 0, 1:] == 0.0)


def merged(timestamp, heard, time):
    """T after one slot of all missions, by plain loops."""
    timestamp = timestamp.copy()
    for b, i in np.ndindex(heard.shape):
        timestamp[b, i, i] = time[b]
    after = timestamp.copy()
    for b, j in np.ndindex(heard.shape):
        after[b, j] = np.maximum(timestamp[b, j], timestamp[b, heard[b, j]])
    return after


def followed(timestamp, windows):
    """T after each of some windows, given their starts and who decodes whom in both slots."""
    found = []
    for now, slots in windows:
        for n, heard in enumerate(slots):
            timestamp = merged(timestamp, heard, now + 0.5 * (n + 1))
        found.append(timestamp)
    return np.array(found)


class Flown(NamedTuple):
    """A window as it was flown, and what a robot's doing otherwise made of it."""

    now: np.ndarray
    slots: list[np.ndarray]  # whom each robot decoded
    known: np.ndarray  # T before it
    active: np.ndarray
    otherwise: dict[tuple[int, int], list[np.ndarray]]  # by mission and robot
    spoke: np.ndarray


@pytest.mark.parametrize(
    ("mission", "channel"),
    [(WALKING, None), (FADED, None), (WALKING, Lossy(WALKING)), (FAILING, None)],
    ids=["walking", "fades and losses", "a channel that draws", "robots that fail"],
)
def test_over_a_horizon_later_windows_are_heard_as_they_were(mission, channel):
    """By the public protocol in a packet's own window, and by plain loops in those after it."""
    components = Components(channel=channel)
    batch = MissionBatch(mission, 2, reward="credit", components=components, unknown_age=7.0)
    rng = np.random.default_rng(1)
    horizon = 5
    flown, replayed = [], []
    batch.restart([4, 2], last_window=12)
    while not batch.is_over:
        swarm, now = batch.flown, batch.flown.now.copy()
        buffers, before = copy.deepcopy(swarm.buffers), snapshot_channel(swarm.channel)
        recipient = random_recipients(rng, batch.shape, 0.25)
        silent = recipient == np.arange(mission.num_robots)
        considered = np.where(silent, random_recipients(rng, batch.shape, 0.3), recipient)
        replayed.append(batch.fly_for_credit(recipient, considered))
        slots = [phase.heard for phase in swarm.phases]
        otherwise = {}
        for b, i in np.argwhere(considered != np.arange(mission.num_robots)).tolist():
            changed = recipient.copy()
            changed[b, i] = considered[b, i] if silent[b, i] else i
            states = settled(swarm.states, changed)
            phases = window(copy.deepcopy(buffers), *states, copy.deepcopy(before), now)
            otherwise[b, i] = [phase.heard for phase in phases]
        known = np.where(buffers.is_known, buffers.timestamp, -7.0)
        flown.append(Flown(now, slots, known, batch.is_active.copy(), otherwise, ~silent))
    credit, alone = credits_over(replayed, horizon).credit, credits_over(replayed, 1).credit
    expected = np.zeros(credit.shape)
    for n, its in enumerate(flown):
        later = flown[n : n + horizon]
        after = followed(its.known, [(each.now, each.slots) for each in later])
        for (b, i), slots in its.otherwise.items():
            others = [(its.now, slots), *[(each.now, each.slots) for each in later[1:]]]
            lost = after[:, b] - followed(its.known, others)[:, b]
            for each, of_window in zip(later, lost, strict=True):
                active = each.active[b]
                counted = np.sum(of_window[np.ix_(active, active)])
                expected[n, b, i] += counted if its.spoke[b, i] else -counted
    np.testing.assert_allclose(credit, expected, atol=1e-9)
    assert np.sum(~np.isclose(credit, alone)) > 20  # news lasts


def test_a_horizon_ends_with_the_mission():
    """What the next mission's robots know was not lost by this one's packets."""
    batch = MissionBatch(WALKING, 2, reward="credit")
    rng = np.random.default_rng(2)
    windows = []
    for seeds in ([4, 2], [3, 5]):
        batch.restart(seeds, last_window=4)
        for _ in range(4):
            recipient = random_recipients(rng, batch.shape, 0.4)
            windows.append(batch.fly_for_credit(recipient))
    together = credits_over(windows, 3).credit
    apart = [credits_over(part, 3).credit for part in (windows[:4], windows[4:])]
    np.testing.assert_array_equal(together, np.concatenate(apart))
    assert np.any(together[2:4] != 0.0)


def test_a_credit_is_whole_if_it_is_that_of_the_mission_flown_on():
    """A mission of 8 windows: cut off after 6 of them, and flown to its end."""
    mission = replace(WALKING, num_windows=8)
    batch = MissionBatch(mission, 2, reward="credit")
    found = []
    for last_window in (6, 8):
        batch.restart([4, 2], last_window=last_window)
        rng = np.random.default_rng(2)
        windows = []
        while not batch.is_over:
            recipient = random_recipients(rng, batch.shape, 0.4)
            windows.append(batch.fly_for_credit(recipient))
        found.append(credits_over(windows, 3))
    cut, over = found
    assert cut.is_whole.tolist() == [True] * 4 + [False] * 2
    assert over.is_whole.all()
    same = np.all(cut.credit == over.credit[:6], axis=(1, 2))
    np.testing.assert_array_equal(same, cut.is_whole)
    stopped = credits_over(windows[:5], 3)  # there is no more of the mission yet
    assert stopped.is_whole.tolist() == [True] * 3 + [False] * 2
