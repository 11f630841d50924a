"""Links against geometry, the radio itself, and loops over transmitters."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import pdist, squareform
from scipy.stats import norm

from swarm_mj.mission import paper
from swarm_mj.radio.fading import NO_FADING, NO_LINE_OF_SIGHT
from swarm_mj.radio.links import (
    STD_STEP_DB,
    air_of,
    among,
    decode_curves,
    doubtful,
    links_between,
    listen,
    lone_probabilities,
    probability_at,
    room_for_interference,
)
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.radio.reception import MIN_DISTANCE_M, NOBODY, incoming_at

seeds = st.integers(0, 2**32 - 1)
RADIO = radio_of(paper("stationary"))  # decodes up to 250 m in silence


def test_links_of_robots_that_are_off_carry_nothing():
    position_m = np.array([[0.0, 0.0], [100.0, 0.0], [50.0, 50.0]])
    links = links_between(RADIO, position_m)
    left = among(links, np.array([True, True, False]))
    assert left.received_mw[0, 1] == links.received_mw[0, 1] > 0.0
    assert left.interference_mw[0, 1] == links.interference_mw[0, 1]
    for powers in (left.received_mw, left.interference_mw):
        assert np.count_nonzero(powers[2]) == np.count_nonzero(powers[:, 2]) == 0
    assert np.all(links.received_mw[2, :2] > 0.0)  # the links themselves stay


@given(seed=seeds)
def test_eq2_links_carry_what_free_space_leaves(seed):
    """Of two robots alone, either decodes the other just up to the range."""
    position_m = np.random.default_rng(seed).uniform(-300.0, 300.0, (8, 2))
    links = links_between(RADIO, position_m)
    is_near = squareform(pdist(position_m)) <= 250.0
    np.fill_diagonal(is_near, False)
    np.testing.assert_array_equal(links.received_mw / links.noise_mw >= links.threshold, is_near)
    np.testing.assert_array_equal(np.diag(links.received_mw), 0.0)
    assert np.all(links.distance_over_std == math.inf)


def test_robots_in_one_place_have_finite_links():
    links = links_between(RADIO, np.zeros((3, 2)), np.full(3, 2.0))
    others = ~np.eye(3, dtype=bool)
    expected_mw = RADIO.received_at_1_m_mw / MIN_DISTANCE_M**2
    assert links.received_mw[others] == pytest.approx(expected_mw)
    assert links.distance_over_std[others] == pytest.approx(MIN_DISTANCE_M / math.sqrt(8.0))


def test_spreads_of_both_ends_add_up_by_hand():
    """Robots 0 and 1 are 50 m apart and believed within 6 and 8 m: 10 m together, a fifth."""
    position_m = np.array([[0.0, 0.0], [30.0, 40.0], [0.0, 100.0]])
    links = links_between(RADIO, position_m, np.array([6.0, 8.0, 0.0]))
    assert links.distance_over_std[0, 1] == links.distance_over_std[1, 0] == pytest.approx(5.0)
    assert links.distance_over_std[0, 2] == pytest.approx(100.0 / 6.0)
    known = links_between(RADIO, position_m, np.array([6.0, 0.0, 0.0]))
    assert known.distance_over_std[1, 2] == math.inf


def test_a_known_distance_of_one_range_is_no_cause_for_concern():
    """Neither is one of nearly no metres."""
    links = links_between(RADIO, np.array([[0.0, 0.0], [250.0, 0.0], [250.0, 0.0]]))
    links = links._replace(noise_mw=1.0, threshold=1.0, received_mw=np.round(links.received_mw))
    links.received_mw[0, 1] = 1.0
    probability = lone_probabilities(links)
    assert probability[0, 1] == 1.0
    assert np.all(np.isfinite(probability))


def listened(links, transmits, also, listens):
    """Whom everyone may decode, and how probably, over an air of these transmitters."""
    heard, probability = np.empty(len(listens), dtype=np.int64), np.empty(len(listens))
    listen(links, air_of(links, transmits), also, listens, heard, probability)
    return heard, probability


@given(seed=seeds, num_robots=st.integers(2, 8), has_one_more=st.booleans())
def test_eq3_the_air_is_what_the_radio_makes_of_it(seed, num_robots, has_one_more):
    """Robots at true places decode as the radio says; whoever does not listen decodes nobody."""
    rng = np.random.default_rng(seed)
    position_m = rng.uniform(-300.0, 300.0, (num_robots, 2))
    transmits, robots = rng.random(num_robots) < 0.4, np.arange(num_robots)
    also = int(rng.integers(num_robots)) if has_one_more else NOBODY
    transmits[robots == also] = False
    everyone = transmits | (robots == also)
    recipient = np.where(everyone, (robots + 1) % num_robots, robots)
    (decoded,) = RADIO(position_m[None], recipient[None])
    listens = ~transmits & (rng.random(num_robots) < 0.8)
    links = links_between(RADIO, position_m)
    heard, probability = listened(links, transmits, also, listens)
    expected = np.where(listens, decoded, robots)
    assert heard.tolist() == expected.tolist()
    assert probability.tolist() == (expected != robots).tolist()


@given(seed=seeds, num_others=st.integers(0, 2), is_certain=st.booleans())
def test_interference_beyond_the_room_for_it_drowns_the_strongest_packet(
    seed, num_others, is_certain
):
    """A millionth less leaves a chance; robot 0 listens, and robot 1 disturbs it."""
    rng = np.random.default_rng(seed)
    num_robots = 3 + num_others
    position_m = rng.uniform(0.0, 100.0, (num_robots, 2))
    spread_m = np.zeros(num_robots) if is_certain else rng.uniform(0.0, 8.0, num_robots)
    links = links_between(RADIO, position_m, spread_m)
    links = links._replace(received_mw=links.received_mw.copy())  # 1 is too weak to be decoded
    links.received_mw[1, 0] = 0.0
    transmits, listens = np.arange(num_robots) > 1, np.arange(num_robots) == 0
    incoming = incoming_at(air_of(links, transmits), 0)
    room_mw = room_for_interference(links, incoming, 0)
    assert (room_mw < 0.0) <= (listened(links, transmits, NOBODY, listens)[1][0] == 0.0)
    scale_mw = room_mw + links.noise_mw + incoming.total
    for share, has_chance in ((1e-6, False), (-1e-6, True)):
        links.interference_mw[1, 0] = room_mw + share * scale_mw
        if 0.0 < links.interference_mw[1, 0] < np.inf:
            _, probability = listened(links, transmits, 1, listens)
            assert (probability[0] > 0.0) == has_chance


def test_curves_leave_room_for_any_interference():
    links = links_between(RADIO, np.array([[0.0, 0.0], [200.0, 0.0]]))
    faded = doubtful(links, decode_curves(NO_LINE_OF_SIGHT), np.zeros((2, 2)))
    incoming = incoming_at(air_of(faded, np.array([True, False])), 1)
    assert room_for_interference(faded, incoming, 1) == np.inf


@pytest.mark.parametrize("deviation", [-1.5, -0.5, 0.0, 1.0])
@pytest.mark.parametrize(
    ("interferer_m", "spread_m", "tolerance"),
    [(1e9, [10.0, 8.0, 0.0], 0.03), (600.0, [12.0, 0.0, 0.0], 0.03), (600.0, [6.0] * 3, 0.1)],
)
def test_probabilities_are_those_of_the_radio_at_random_places(
    interferer_m, spread_m, tolerance, deviation
):
    """Robot 0 speaks to robot 1, near the distance at which its packet just decodes."""
    rng = np.random.default_rng(5)
    spread_m = np.array(spread_m)
    at_1_m, apart_m = RADIO.received_at_1_m_mw, interferer_m - 200.0
    least_mw = RADIO.threshold * (RADIO.noise_mw + at_1_m / apart_m**2)
    distance_m = math.sqrt(at_1_m / least_mw) - deviation * math.hypot(*spread_m[:2])
    position_m = np.array([[200.0 - distance_m, 0.0], [200.0, 0.0], [interferer_m, 0.0]])
    true_m = position_m + spread_m[:, None] * rng.standard_normal((4000, 3, 2))
    heard = RADIO(true_m, np.tile([1, 1, 0], (4000, 1)))
    links = links_between(RADIO, position_m, spread_m)
    listens = np.array([False, True, False])
    _, probability = listened(links, ~listens, NOBODY, listens)
    assert probability[1] == pytest.approx(np.mean(heard[:, 1] == 0), abs=tolerance)


MARGINS_DB = (-12.0, -3.1, 0.4, 2.3, 9.8)


def at(curves, margin_db, std_db=0.0):
    return probability_at(curves, round(std_db / STD_STEP_DB), 10.0 ** (margin_db / 10.0))


def test_without_fades_a_packet_decodes_or_not():
    curves = decode_curves(NO_FADING)
    assert [at(curves, margin) for margin in (-30.0, -0.3, 0.0, 0.3, 60.0)] == [0, 0, 1, 1, 1]


@pytest.mark.parametrize("std_db", [1.0, 6.0])
@pytest.mark.parametrize("margin_db", MARGINS_DB)
def test_doubt_in_db_is_normal(std_db, margin_db):
    expected = norm.cdf(margin_db / std_db)
    assert at(decode_curves(NO_FADING), margin_db, std_db) == pytest.approx(expected, abs=0.03)


@pytest.mark.parametrize("std_db", [0.0, 3.0])
@pytest.mark.parametrize("rician_k", [NO_LINE_OF_SIGHT, 0.5, 4.0, 60.0, 400.0, 10_000.0])
def test_doubt_and_fades_add_up(rician_k, std_db):
    """Drawn by the thousands; the same share of packets is lost otherwise."""
    rng = np.random.default_rng(1)
    in_phase, quadrature, error = rng.normal(size=(3, 200_000))
    scattered = (in_phase + 1j * quadrature) / math.sqrt(2.0)
    amplitude = (math.sqrt(rician_k) + scattered) / math.sqrt(rician_k + 1.0)
    power_db = 20.0 * np.log10(np.abs(amplitude)) + std_db * error
    curves = decode_curves(rician_k, success=0.7)
    for margin_db in MARGINS_DB:
        expected = 0.7 * np.mean(power_db + margin_db >= 0.0)
        assert at(curves, margin_db, std_db) == pytest.approx(expected, abs=8e-3)
