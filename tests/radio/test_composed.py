"""The composed channel against free space, laws, loops in NumPy, and replays of its slots."""

import math

import numpy as np
import pytest

from swarm_mj.mission import paper, reference
from swarm_mj.radio.composed import ComposedChannel
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.radio.power_law import PowerLaw
from swarm_mj.radio.reception import Reception

NUM_ROBOTS = 12
SHADOWED = {"shadowing_db": 6.0, "shadowing_distance_m": 20.0}


def started(seeds, law, reception, **shadowing):
    made = ComposedChannel(law, reception, **shadowing)
    made.start(len(law.at_1_m), [np.random.default_rng(seed) for seed in seeds])
    return made


def channel(seeds, *, mission=None, at_1_m_mw=None, shadowing=None, **reception):
    radio = radio_of(mission or paper("stationary"))
    if at_1_m_mw is None:
        at_1_m_mw = np.full(NUM_ROBOTS, radio.received_at_1_m_mw)
    rule = Reception(
        noise_mw=radio.noise_mw,
        threshold=radio.threshold,
        recipient_hears_while_sending=radio.recipient_hears_while_sending,
        **reception,
    )
    return started(seeds, PowerLaw(at_1_m_mw), rule, **shadowing or {})


def scenes(seed, num_missions):
    rng = np.random.default_rng(seed)
    position_m = rng.uniform(-300.0, 300.0, (num_missions, NUM_ROBOTS, 2))
    anybody = rng.integers(-1, NUM_ROBOTS, (num_missions, NUM_ROBOTS))
    is_silent = rng.random(anybody.shape) < 0.7
    return position_m, np.where(is_silent, np.arange(NUM_ROBOTS), anybody)


def heard_in(slot, made, position_m, recipient, mission=None):
    """Whom all decode in a slot; rows are all missions in order, or these."""
    mission = np.arange(len(recipient)) if mission is None else np.array(mission)
    return made.at(np.full(len(mission), slot), mission)(position_m, recipient)


def only(sender, num_missions):
    """One robot transmits."""
    recipient = np.tile(np.arange(NUM_ROBOTS), (num_missions, 1))
    recipient[:, sender] = -1
    return recipient


@pytest.mark.parametrize("mission", [paper("stationary"), reference("stationary")])
def test_without_parts_it_is_the_papers_radio(mission):
    made = channel(range(20), mission=mission)
    for seed in range(10):
        scene = scenes(seed, 20)
        np.testing.assert_array_equal(heard_in(seed, made, *scene), radio_of(mission)(*scene))


def test_a_lone_rayleigh_packet_decodes_by_the_law():
    """At half the range the mean SNR is 4 times the threshold: P = exp(-1 / 4)."""
    made = channel(range(200), rician_k=0.0)
    position_m = np.zeros((200, NUM_ROBOTS, 2))
    position_m[:, 1:, 0] = 125.0
    heard = [heard_in(s, made, position_m, only(0, 200)) for s in range(5)]
    decoded = np.mean(np.array(heard)[:, :, 1:] == 0)
    assert decoded == pytest.approx(math.exp(-0.25), abs=0.02)


def test_erasures_lose_their_share_and_nothing_else():
    made, plain = channel(range(50), erasure=0.3), channel(range(50))
    num_kept = num_sent = 0
    for s in range(20):
        without, heard = (heard_in(s, each, *scenes(1, 50)) for each in (plain, made))
        is_kept = heard == without
        assert np.all(is_kept | (heard == np.arange(NUM_ROBOTS)))
        received = without != np.arange(NUM_ROBOTS)
        num_kept, num_sent = num_kept + np.sum(is_kept & received), num_sent + np.sum(received)
    assert num_kept / num_sent == pytest.approx(0.7, abs=4 * math.sqrt(0.21 / num_sent))


def test_a_receiver_in_a_burst_decodes_nobody():
    made, plain = channel([4], burst_begin=0.05, burst_end=0.1), channel([4])
    position_m = np.zeros((1, NUM_ROBOTS, 2))
    position_m[0, :, 0] = np.arange(NUM_ROBOTS)
    assert np.all(heard_in(0, plain, position_m, only(0, 1)) == 0)
    slots = [heard_in(s, made, position_m, only(0, 1)) for s in range(2000)]
    is_good = np.concatenate(slots)[:, 1:] == 0
    assert np.mean(is_good) == pytest.approx(2 / 3, abs=0.06)
    stays = np.mean(is_good[1:] == is_good[:-1])
    assert stays == pytest.approx(1 - 2 * (2 / 3) * 0.05, abs=0.02)


HARD = {
    "rician_k": 2.0,
    "erasure": 0.2,
    "burst_begin": 0.05,
    "burst_end": 0.2,
    "shadowing": SHADOWED,
}


def test_a_mission_does_not_depend_on_those_beside_it():
    many, alone = channel(range(5), **HARD), channel([3], **HARD)
    for slot in range(30):
        position_m, recipient = scenes(slot, 5)
        together = heard_in(slot, many, position_m, recipient)
        single = heard_in(slot, alone, position_m[3:4], recipient[3:4])
        np.testing.assert_array_equal(together[3], single[0])


def test_a_slot_that_is_played_again_is_the_same_slot():
    made = channel(range(3), **HARD)
    position_m, recipient = scenes(0, 3)
    first = [heard_in(s, made, position_m, recipient) for s in range(8)]
    rows = [2, 0, 0, 1]
    for s in reversed(range(8)):
        again = heard_in(s, made, position_m[rows], recipient[rows], rows)
        np.testing.assert_array_equal(again, first[s][rows])


def test_one_robots_silence_changes_no_other_links_fade():
    """Credit replays a window without one robot: the others' fades must stay."""
    made = channel(range(40), rician_k=0.0)
    position_m, recipient = scenes(5, 40)
    position_m[:, 0] = 1e7  # so far off that nobody notices its packets
    heard = []
    for silent_or_broadcasting in (0, -1):
        recipient[:, 0] = silent_or_broadcasting
        heard.append(heard_in(6, made, position_m, recipient)[:, 1:])
    np.testing.assert_array_equal(heard[0], heard[1])


def test_fades_and_shadowing_are_the_same_in_both_directions():
    """Two robots 200 m apart, each alone on the air in the same slot: both hear, or neither."""
    made = channel(range(30), rician_k=2.0, shadowing=SHADOWED)
    position_m = np.zeros((30, NUM_ROBOTS, 2))
    position_m[:, 1:, 0] = 200.0
    hears = {}
    for sender, listener in ((0, 1), (1, 0)):
        slots = [heard_in(s, made, position_m, only(sender, 30)) for s in range(20)]
        hears[sender] = np.array(slots)[:, :, listener] == sender
    np.testing.assert_array_equal(hears[0], hears[1])
    assert 0.2 < np.mean(hears[0]) < 0.9


def test_a_team_is_connected_if_everyone_reaches_everyone():
    """Robots in a row 200 m apart reach their neighbours only; the last one stands at 1000 m."""
    made = channel([0])
    row_m = np.zeros((NUM_ROBOTS, 2))
    row_m[:, 0] = 200.0 * np.arange(NUM_ROBOTS)
    assert np.all(made.largest_part(row_m, 0))
    row_m[-1, 0] += 100.0
    assert made.largest_part(row_m, 0).tolist() == [True] * 11 + [False]
    row_m[5:, 0] += 100.0  # 5 robots, 6, and the last one
    assert made.largest_part(row_m, 0).tolist() == [False] * 5 + [True] * 6 + [False]


def test_being_heard_is_not_enough_to_be_connected():
    """Robot 0 sends with 20 dB more: at 2000 m it is heard by others, which it does not hear."""
    at_1_m_mw = np.full(NUM_ROBOTS, radio_of(paper("stationary")).received_at_1_m_mw)
    at_1_m_mw[0] *= 100.0
    made = channel([0], at_1_m_mw=at_1_m_mw)
    position_m = np.zeros((NUM_ROBOTS, 2))
    for apart_m, is_connected in ((240.0, True), (2000.0, False)):
        position_m[0, 0] = apart_m
        assert np.all(made.largest_part(position_m, 0)) == is_connected


EVERYONE = np.ones((2, 4), dtype=bool)
SENT = np.array([1.0, 1.0, 4.0, 1.0])  # after one metre


def gains(**shadowing):
    return started((1, 2), PowerLaw(SENT), Reception(1.0, 1.0), **shadowing)


def places(seed=0):
    return np.random.default_rng(seed).uniform(-300.0, 300.0, (2, 4, 2))


def test_powers_are_computed_once_for_each_sender_and_place():
    """What is computed already is not written again."""
    made, position_m, mission = gains(), places(), np.arange(2)
    powers = made.received_mw(position_m, mission, EVERYONE & (np.arange(4) == 0))
    powers[:] = -1.0
    made.received_mw(position_m, mission, EVERYONE)
    np.testing.assert_array_equal(powers < 0.0, np.arange(4)[:, None] == [[[0] * 4]] * 2)
    powers[:] = -1.0
    position_m[1, 3] += 1.0  # mission 1 moves, mission 0 stays
    made.received_mw(position_m, mission, EVERYONE)
    assert np.all(powers < 0.0, axis=(1, 2)).tolist() == [True, False]
    assert np.all(powers[1] >= 0.0)


def test_moving_back_finds_the_same_shadowing():
    made, there, here = gains(**SHADOWED), *map(places, (1, 2))
    first = made.received_mw(there, np.arange(2), EVERYONE).copy()
    made.received_mw(here, np.arange(2), EVERYONE)
    np.testing.assert_array_equal(made.received_mw(there, np.arange(2), EVERYONE), first)
