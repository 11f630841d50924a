"""Notes by hand: the kinds of packets that robots decode or miss, and how often."""

import math

import numpy as np
import pytest

from swarm_mj.policies.planner.link_evidence import (
    LEAST_MARGIN_DB,
    MAX_KINDS,
    MAX_TIMES,
    NOTHING,
    NUM_BINS,
    Evidence,
    observe,
)
from swarm_mj.policies.planner.link_tables import (
    BIN_CENTRES_DB,
)
from swarm_mj.radio.links import KNOWN, Links

KINDS = (2, 4, NUM_BINS)  # whether decoded, the sender of four, the bin
NOISE_MW, THRESHOLD = 1.0, 10.0  # so a packet of 10 mW has a margin of 0 dB in silence


def powers(**of_link):
    """Power of i at j, 1 nW but where it is given as `i_at_j`-like names: p01 is of 0 at 1 [mW]."""
    power_mw = np.full((4, 4), 1e-6)
    for name, value in of_link.items():
        power_mw[int(name[1]), int(name[2])] = value
    return power_mw


def observed(
    heard, transmitted, believed_mw, *, prior_mw=None, listens=None, distance_over_std=np.inf
):
    """Whom each robot notes, in which bin, and whether as decoded; None if nothing."""
    transmitted = np.array(transmitted, dtype=bool)
    prior_mw = believed_mw if prior_mw is None else prior_mw
    doubt, row = np.full((4, 4), distance_over_std), np.zeros((4, 4), dtype=np.int64)
    prior = Links(prior_mw, doubt, NOISE_MW, THRESHOLD, KNOWN, row, prior_mw)
    listens = ~transmitted if listens is None else listens
    noted = observe(listens, np.array(heard), transmitted, believed_mw, prior)
    kinds = [None if kind == NOTHING else np.unravel_index(kind, KINDS) for kind in noted]
    return [kind and (kind[1], kind[2], bool(kind[0])) for kind in kinds]


def test_bins_are_two_db_wide_around_their_centres():
    assert BIN_CENTRES_DB[[0, 7, 8, -1]].tolist() == [-15.0, -1.0, 1.0, 31.0]


def test_a_margin_is_the_sinr_over_the_threshold_by_hand():
    """Robot 1 hears 0 with 100 mW: 10 dB over what it needs in silence, which is in bin 13, around
    11 dB. Beside 9 mW of robot 2, noise and interference are 10 times as much: 0 dB, in bin 8."""
    power_mw = powers(p01=100.0, p21=9.0, p03=100.0, p23=9.0)
    alone = observed([0, 0, 2, 0], [1, 0, 0, 0], power_mw)
    assert alone[1] == alone[3] == (0, 13, True)
    beside = observed([0, 0, 2, 3], [1, 0, 1, 0], power_mw)
    assert beside == [None, (0, 8, True), None, (0, 8, False)]


def test_the_strongest_of_the_others_is_missed_and_in_the_plan_s_own_powers():
    """Before, 2 was believed weaker at 3 than 0; by what was learned it is stronger. The margin is
    counted from before: 50 over (1 + 20) times 10, or -6.2 dB, in bin 4."""
    prior_mw = powers(p03=80.0, p23=50.0)
    believed_mw = powers(p03=20.0, p23=60.0)
    noted = observed([0, 1, 2, 3], [1, 0, 1, 0], believed_mw, prior_mw=prior_mw)
    assert 10.0 * math.log10(50.0 / 210.0) == pytest.approx(-6.2, abs=0.05)
    assert noted[3] == (2, 4, False)


def test_whoever_decoded_notes_whom_it_decoded_even_if_that_is_a_surprise():
    """The weaker one, or one of whom the plan says that it is silent."""
    power_mw = powers(p01=100.0, p21=50.0, p31=20.0)
    transmits = [1, 0, 1, 0]
    assert observed([0, 2, 2, 3], transmits, power_mw)[1] == (2, 1, True)  # 50 / 1010: -13.1 dB
    # Robot 3's 20 mW come beside all 150 mW of the plan: -18.8 dB, which the lowest bin takes.
    assert observed([0, 3, 2, 3], transmits, power_mw)[1] == (3, 0, True)


@pytest.mark.parametrize(("margin_db", "is_missed"), [(-15.9, True), (-16.1, False)])
def test_packets_that_are_too_weak_are_not_missed_but_may_be_decoded(margin_db, is_missed):
    assert LEAST_MARGIN_DB - 1.0 == -16.0
    power_mw = powers(p01=10.0 ** (1.0 + margin_db / 10.0))
    noted = observed([0, 1, 2, 3], [1, 0, 0, 0], power_mw)[1]
    assert noted == ((0, 0, False) if is_missed else None)
    assert observed([0, 0, 2, 3], [1, 0, 0, 0], power_mw)[1] == (0, 0, True)
    strong_mw = powers(p01=1e9)
    assert observed([0, 0, 2, 3], [1, 0, 0, 0], strong_mw)[1] == (0, NUM_BINS - 1, True)


@pytest.mark.parametrize(("margin_db", "is_noted"), [(2.5, False), (2.7, True), (-2.7, True)])
def test_packets_that_errors_of_positions_may_decide_are_not_noted(margin_db, is_noted):
    """A distance known to a tenth is a power known to 0.87 dB; three times that is 2.6 dB."""
    power_mw = powers(p01=10.0 * 10.0 ** (margin_db / 10.0), p03=1e4)
    for heard in ([0, 0, 2, 0], [0, 1, 2, 0]):
        noted = observed(heard, [1, 0, 0, 0], power_mw, distance_over_std=10.0)
        assert (noted[1] is not None) == is_noted
        assert noted[3] is not None


def test_who_notes_nothing():
    """Who does not listen to a plan, or anybody when nobody transmits. One that should transmit by
    a plan that it has left misses what the others send."""
    power_mw, listens = powers(p01=100.0, p02=100.0, p03=100.0), np.arange(4) == 1
    noted = observed([0, 0, 0, 0], [1, 0, 0, 0], power_mw, listens=listens)
    assert noted == [None, (0, 13, True), None, None]
    assert observed([0, 1, 2, 3], [0, 0, 0, 0], power_mw) == [None] * 4
    noted = observed([0, 1, 2, 3], [1, 1, 0, 0], powers(p01=100.0), listens=listens)
    assert noted[1] == (0, 13, False)


def kind_of(is_decoded, i, margin, num_robots):
    return np.ravel_multi_index((int(is_decoded), i, margin), (2, num_robots, NUM_BINS))


def of_one(i, margin, is_decoded, num_robots=2):
    """Robot 0 observed this, and the others nothing."""
    return np.array([kind_of(is_decoded, i, margin, num_robots), *[NOTHING] * (num_robots - 1)])


def test_counts_are_a_plain_loop_up_to_each_robot_s_slot():
    rng = np.random.default_rng(3)
    evidence, known_until = Evidence(5), np.array([-2, 0, 20, 59, 80])
    expected = np.zeros((2, 5, 5, NUM_BINS), dtype=int)
    for slot in range(60):
        kinds = np.full(5, NOTHING)
        for j in np.flatnonzero(rng.random(5) < 0.8).tolist():
            is_decoded, i, margin = bool(rng.random() < 0.5), rng.integers(5), rng.integers(4)
            kinds[j] = kind_of(is_decoded, i, margin, 5)
            expected[int(is_decoded), j, i, margin] += slot <= known_until[j]
        evidence.add(kinds)
    decoded, missed = evidence.counts(known_until)
    np.testing.assert_array_equal(decoded, expected[1])
    np.testing.assert_array_equal(missed, expected[0])


def test_a_kind_is_noted_255_times_and_no_more():
    evidence = Evidence(2)
    for _ in range(MAX_TIMES + 4):
        evidence.add(of_one(1, 5, True))
    evidence.add(of_one(1, 5, False))  # another kind is counted on its own
    decoded, missed = evidence.counts(np.full(2, 1000))
    assert decoded[0, 1, 5] == decoded.sum() == 255 == MAX_TIMES
    assert missed[0, 1, 5] == missed.sum() == 1
    assert evidence.counts(np.full(2, 99))[0].sum() == 100  # those noted first


def test_full_notes_take_no_new_kind_but_count_on():
    """Of 24 bins and two fates with three senders, each noted once, the first 64 stay."""
    evidence = Evidence(4)
    kinds = [(i, k, fate) for i in (1, 2, 3) for k in range(NUM_BINS) for fate in (True, False)]
    for kind in [*kinds, *kinds]:
        evidence.add(of_one(*kind, num_robots=4))
    counts = dict(zip((True, False), evidence.counts(np.full(4, 1000)), strict=True))
    times = [int(counts[fate][0, i, k]) for i, k, fate in kinds]
    assert times == [2] * MAX_KINDS + [0] * (len(kinds) - MAX_KINDS)
    assert not counts[True][1:].any()
