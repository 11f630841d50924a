"""Beliefs and true links against laws, and against how often packets then decode."""

import math

import numpy as np
import pytest
from scipy.stats import norm
from walls import walls

from swarm_mj.mission import paper
from swarm_mj.mission.specification import KNOWABLE
from swarm_mj.radio.link_models import TrueLinks
from swarm_mj.radio.links import links_between, lone_probabilities
from swarm_mj.radio.mission_radio import mission_radio, radio_of
from swarm_mj.radio.power_law import NO_OBSTACLES

WALL = walls(0.1, 0)  # 10 dB, between x < 0 and x > 0
ON_A_LINE_M = np.array([[-100.0, 0.0], [-20.0, 0.0], [100.0, 0.0]])


def chances(position_m=ON_A_LINE_M, *, obstacles=NO_OBSTACLES, **fields):
    """What the robots of such a mission believe that lone packets decode with."""
    belief = mission_radio(paper(num_robots=len(position_m), **fields), obstacles).belief
    return lone_probabilities(belief.links(position_m))


@pytest.mark.parametrize(
    "fields",
    [
        {"fading": "rayleigh", "shadowing_db": 6.0, "path_loss": "two-ray", "erasure": 0.5},
        {"fading": "rayleigh", "prior_knowledge": "map"},  # there is nothing on it
        {"prior_knowledge": "statistics"},  # are those of free space
        {"prior_knowledge": "map,statistics,start"},
    ],
)
def test_without_knowledge_belief_is_free_space_to_the_last_digit(fields):
    position_m, spread_m = ON_A_LINE_M, np.array([0.0, 10.0, 20.0])
    is_known = np.array([True, True, False])
    belief = mission_radio(paper(num_robots=3, **fields)).belief
    expected = links_between(radio_of(paper()), position_m, spread_m, is_known)
    for mine, its in zip(belief.links(position_m, spread_m, is_known), expected, strict=True):
        np.testing.assert_array_equal(mine, its)


@pytest.mark.parametrize("known", KNOWABLE)
def test_only_who_knows_the_map_reckons_with_a_wall(known):
    """Its 10 dB are as much as a factor of 3.2 in distance: 120 and 200 m are too far then."""
    linked = chances(
        obstacles=WALL, prior_knowledge=known, path_loss="log-distance", reference_m=900.0
    )
    through = [linked[0, 2], linked[2, 0], linked[1, 2], linked[2, 1]]
    assert through == ([0.0] * 4 if known == "map" else [1.0] * 4)
    assert linked[0, 1] == linked[1, 0] == 1.0


def test_rayleigh_outage_by_its_law():
    """A lone packet just decodes at 250 m: P = exp(-(d / 250 m)²), times what is not lost.

    Bursts take 0.02 / (0.02 + 0.06) of the slots.
    """
    fields = {"fading": "rayleigh", "erasure": 0.3, "burst_begin": 0.02, "burst_end": 0.06}
    probability = chances(prior_knowledge="statistics", **fields)
    for i, j, apart_m in ((0, 1, 80.0), (1, 2, 120.0), (2, 0, 200.0)):
        expected = 0.7 * 0.75 * math.exp(-((apart_m / 250.0) ** 2))
        assert probability[i, j] == pytest.approx(expected, abs=2e-3)


def test_unknown_shadowing_is_doubt_by_its_law():
    probability = chances(prior_knowledge="statistics", shadowing_db=6.0)
    for i, j, apart_m in ((0, 1, 80.0), (1, 2, 120.0), (2, 0, 200.0)):
        margin_db = 20.0 * math.log10(250.0 / apart_m)
        assert probability[i, j] == pytest.approx(norm.cdf(margin_db / 6.0), abs=5e-3)


def test_strong_radios_are_known_by_their_statistics():
    """12 dB more are as much as a factor of 4 in distance, in one direction."""
    far_m = np.array([[0.0, 0.0], [900.0, 0.0]])
    fields = {"high_power_fraction": 0.5, "high_power_db": 12.0}
    assert chances(far_m, prior_knowledge="statistics", **fields).tolist() == [
        [0.0, 1.0],
        [0.0, 0.0],
    ]
    assert not np.any(chances(far_m, prior_knowledge="map", **fields))


def test_who_is_unknown_is_not_counted_on_by_any_law():
    belief = mission_radio(
        paper(num_robots=3, path_loss="two-ray", prior_knowledge="statistics")
    ).belief
    links = belief.links(ON_A_LINE_M, np.zeros(3), np.array([True, True, False]))
    assert links.received_mw[0, 1] > 0.0
    assert not np.any(links.received_mw[2])
    assert not np.any(links.received_mw[:, 2])


def test_an_error_of_distance_weighs_more_where_power_falls_more_steeply():
    """At 100 m, known to sqrt(2) 5 m: with d⁻⁴ beyond 20 m that counts twice."""
    fields = {"path_loss": "log-distance", "loss_exponent": 4.0, "reference_m": 20.0}
    belief = mission_radio(paper(num_robots=3, prior_knowledge="statistics", **fields)).belief
    position_m = np.array([[0.0, 0.0], [10.0, 0.0], [100.0, 0.0]])
    over_std = belief.links(position_m, np.full(3, 5.0)).distance_over_std
    assert over_std[0, 1] == pytest.approx(10.0 / (5.0 * math.sqrt(2.0)))
    assert over_std[0, 2] == pytest.approx(100.0 / (5.0 * math.sqrt(2.0)) / 2.0)


FADING = {"fading": "rician", "rician_k": 2.0, "shadowing_db": 6.0, "erasure": 0.2}
LOSSES = {
    "path_loss": "log-distance",
    "high_power_fraction": 0.5,
    "burst_begin": 0.05,
    "burst_end": 0.2,
}


@pytest.mark.parametrize("fields", [{"shadowing_db": 6.0}, FADING, FADING | LOSSES])
def test_true_links_decode_as_often_as_the_channel_lets_them(fields):
    """Each robot in turn sends alone in every slot of so many; behind the wall, too."""
    mission, num_slots = paper(num_robots=4, **fields), 4000
    channel = mission_radio(mission, WALL).channel
    channel.start(4, [np.random.default_rng(seed) for seed in (1, 2)])
    position_m = np.array([[-90.0, 0.0], [-20.0, 60.0], [60.0, 0.0], [90.0, 30.0]])
    links = TrueLinks(radio=radio_of(mission), channel=channel).links(position_m, 1)
    expected = lone_probabilities(links)
    places_m = np.broadcast_to(position_m, (num_slots, 4, 2)).copy()
    in_slots = channel.at(np.arange(num_slots), np.ones(num_slots, dtype=int))
    for i in range(4):
        recipient = np.tile(np.where(np.arange(4) == i, -1, np.arange(4)), (num_slots, 1))
        often = np.mean(in_slots(places_m, recipient) == i, axis=0)
        others = np.arange(4) != i
        np.testing.assert_allclose(often[others], expected[i, others], atol=0.04)


def test_true_links_of_free_space_are_those_of_the_radio():
    links = TrueLinks(radio=radio_of(paper())).links(ON_A_LINE_M, 0)
    for mine, its in zip(links, links_between(radio_of(paper()), ON_A_LINE_M), strict=True):
        np.testing.assert_array_equal(mine, its)
