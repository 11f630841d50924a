"""The hand-made heuristic of what news is worth."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from standing_teams import flooded_team

from swarm_mj.mission import paper
from swarm_mj.policies.planner.link_graph import OUT_OF_REACH, link_graph
from swarm_mj.policies.planner.settings import WeightSettings
from swarm_mj.policies.planner.weights import heuristic_weights
from swarm_mj.radio.links import links_between
from swarm_mj.radio.mission_radio import radio_of

seeds = st.integers(0, 2**32 - 1)
RADIO = radio_of(paper("stationary"))  # decodes up to 250 m in silence
SETTINGS = WeightSettings(
    downstream_exponent=0.6,
    hops_exponent=-0.3,
    share_unlinked=0.95,
    share_per_link=-0.3,
    share_per_std=3.0,
    share_isolated=0.1,
    max_share=1.05,
)


def team_links(num_robots, seed, spread_m=None, **overrides):
    mission = paper("stationary", num_robots=num_robots, range_ratio=0.2, **overrides)
    team = flooded_team(mission, seed)
    spread = None if spread_m is None else np.full(num_robots, spread_m)
    return links_between(team.radio, team.position_m, spread)


def line(*position_m, spread_m=None, is_known=None):
    """Robots in a row."""
    places = np.array([[x, 0.0] for x in position_m])
    spread = None if spread_m is None else np.full(len(places), spread_m)
    return links_between(RADIO, places, spread, is_known)


def weights_of(links):
    return heuristic_weights(links, SETTINGS)


def test_a_row_of_three_by_hand():
    """Robot 0's news reach robot 2 through robot 1, two hops on; two of three pairs are linked."""
    worth = weights_of(line(0.0, 200.0, 400.0))
    assert worth.squared_rise[1, 0] == pytest.approx(2.0**0.6)
    assert worth.squared_rise[2, 0] == pytest.approx(2.0**-0.3)
    assert worth.squared_rise[0, 1] == pytest.approx(1.0)
    assert worth.least_share == pytest.approx(0.95 - 0.3 * 2 / 3)


@given(seed=seeds, num_robots=st.integers(3, 9))
def test_who_has_more_behind_it_and_is_as_far_is_worth_more(seed, num_robots):
    """And who is farther with as many behind it is worth less."""
    links = team_links(num_robots, seed)
    squared, graph = weights_of(links).squared_rise, link_graph(links, SETTINGS)
    for k in range(num_robots):
        told = [j for j in range(num_robots) if j != k and graph.hops[j, k] < OUT_OF_REACH]
        for a in told:
            for b in told:
                behind, hops = (x[a, k] - x[b, k] for x in (graph.downstream, graph.hops))
                if behind >= 0 and hops <= 0:
                    assert squared[a, k] >= squared[b, k]
                if (behind > 0 and hops <= 0) or (behind >= 0 and hops < 0):
                    assert squared[a, k] > squared[b, k]


def test_the_share_falls_with_links_and_rises_with_doubt_up_to_its_most():
    sparse, dense = line(0.0, 200.0, 400.0, 600.0), line(0.0, 80.0, 160.0, 240.0)
    assert weights_of(dense).least_share < weights_of(sparse).least_share
    shares = [
        weights_of(line(0.0, 80.0, 160.0, 240.0, spread_m=s)).least_share
        for s in (0.1, 1.0, 9.0, 99.0)
    ]
    assert weights_of(dense).least_share < shares[0] < shares[1] < shares[2]
    assert shares[3] == 1.05


def test_the_share_rises_where_a_robot_is_missing():
    """Two of three robots are known, and linked: 0.95 less 0.3, and 0.1 more."""
    worth = weights_of(line(0.0, 100.0, 200.0, is_known=np.array([True, True, False])))
    assert worth.least_share == pytest.approx(0.95 - 0.3 + 0.1)


@given(seed=seeds, num_robots=st.integers(2, 8), is_certain=st.booleans())
def test_robots_under_other_names_are_worth_the_same(seed, num_robots, is_certain):
    links = team_links(num_robots, seed, None if is_certain else 20.0)
    named = np.random.default_rng(seed).permutation(num_robots)
    renamed = links._replace(
        received_mw=links.received_mw[np.ix_(named, named)],
        distance_over_std=links.distance_over_std[np.ix_(named, named)],
    )
    expected = weights_of(links).squared_rise[np.ix_(named, named)]
    np.testing.assert_allclose(weights_of(renamed).squared_rise, expected, rtol=1e-6)
    assert weights_of(renamed).least_share == pytest.approx(weights_of(links).least_share)


def test_teams_without_links_have_finite_worth():
    worth = weights_of(line(0.0, 5000.0, spread_m=3.0))
    assert np.all(np.isfinite(worth.squared_rise))
    assert worth.least_share == 1.05
