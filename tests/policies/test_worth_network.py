"""The network that says what news is worth, held against plain loops."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from standing_teams import flooded_team

from swarm_mj.mission import paper
from swarm_mj.policies.schedule import links_between
from swarm_mj.policies.worth import Scorer
from swarm_mj.policies.worth_network import (
    PAIR_FEATURES,
    ROBOT_FEATURES,
    SHAPES,
    TeamFeatures,
    WorthNetwork,
    forward,
    num_weights,
    team_features,
    unpacked,
)

seeds = st.integers(0, 2**32 - 1)


def random_weights(seed=0):
    return unpacked(0.5 * np.random.default_rng(seed).standard_normal(num_weights()))


def network(parameters):
    return WorthNetwork(parameters, digest="abc")


def team_links(num_robots, seed, *, is_certain=False, lacks=()):
    mission = paper("stationary", num_robots=num_robots, range_ratio=0.2)
    team = flooded_team(mission, seed)
    spread_m = np.random.default_rng(seed).uniform(1.0, 60.0, num_robots)
    is_known = ~np.isin(np.arange(num_robots), lacks)
    spread = None if is_certain else spread_m
    return links_between(team.radio, team.position_m, spread, is_known)


def feature(features, name):
    """One of a robot's features or of a pair's."""
    if name in ROBOT_FEATURES:
        return features.robot[:, ROBOT_FEATURES.index(name)]
    return features.pair[:, :, PAIR_FEATURES.index(name)]


def test_the_network_is_a_scorer_known_by_its_digest():
    scorer = network(random_weights())
    assert isinstance(scorer, Scorer)
    assert scorer.parameters == {"digest": "abc"}


@given(seed=seeds, num_robots=st.integers(2, 9), is_certain=st.booleans())
def test_weights_for_every_receiver_and_subject_whatever_the_team(seed, num_robots, is_certain):
    """Of any size, with robots that nobody knows of; the share lies where it may."""
    lacks = np.flatnonzero(np.random.default_rng(seed).random(num_robots) < 0.3)
    links = team_links(num_robots, seed, is_certain=is_certain, lacks=lacks)
    *weights, share = network(random_weights(seed))(links)
    for array in weights:
        assert array.shape == (num_robots, num_robots)
        assert array.dtype == np.float32
        assert array.flags.c_contiguous
        assert np.all(np.isfinite(array))
    assert isinstance(share, float)
    assert 0.4 <= share <= 1.1


@given(seed=seeds, num_robots=st.integers(2, 9), is_certain=st.booleans())
def test_robots_under_other_names_are_worth_the_same(seed, num_robots, is_certain):
    links = team_links(num_robots, seed, is_certain=is_certain, lacks=[seed % num_robots])
    named = np.random.default_rng(seed).permutation(num_robots)
    renamed = links._replace(
        received_mw=links.received_mw[np.ix_(named, named)],
        sharpness=links.sharpness[np.ix_(named, named)],
    )
    scorer = network(random_weights(seed))
    before, after = scorer(links), scorer(renamed)
    for expected, given_now in zip(before[:3], after[:3], strict=True):
        np.testing.assert_allclose(given_now, expected[np.ix_(named, named)], atol=1e-5)
    assert after.least_share == pytest.approx(before.least_share, abs=1e-6)


def test_the_weights_tell_robots_apart():
    """Receivers, subjects and teams: what is learned may depend on each."""
    scorer = network(random_weights(1))
    worth, other = scorer(team_links(6, 1)), scorer(team_links(6, 2))
    for array, elsewhere in zip(worth[:3], other[:3], strict=True):
        assert np.all(np.std(array, axis=0) > 0.0)
        assert np.all(np.std(array, axis=1) > 0.0)
        assert not np.allclose(array, elsewhere)
    assert worth.least_share != other.least_share


def dot(row, matrix, column):
    return sum(float(x) * float(w[column]) for x, w in zip(row, matrix, strict=True))


@pytest.mark.parametrize("num_robots", [2, 5])
def test_the_message_pass_by_plain_loops(num_robots):
    p, features = random_weights(3), team_features(team_links(num_robots, 3))
    robots = range(num_robots)
    vector = [[0.0] * 6 for _ in robots]
    for j in robots:
        for c in range(6):
            told = sum(
                features.heard[j, i] * dot(features.robot[i], p["neighbours"], c) for i in robots
            )
            own = dot(features.robot[j], p["own"], c)
            vector[j][c] = math.tanh(own + told + p["robot_bias"][c])
    weights, share = forward(p, features, np.tanh)
    for j in robots:
        for k in robots:
            pair = [
                math.tanh(
                    dot(vector[j], p["receiver"], c)
                    + dot(vector[k], p["subject"], c)
                    + dot(features.pair[j, k], p["pair"], c)
                    + p["pair_bias"][c]
                )
                for c in range(8)
            ]
            expected = [dot(pair, p["weights"], c) + p["weights_bias"][c] for c in range(3)]
            assert weights[j, k].tolist() == pytest.approx(expected, rel=1e-4, abs=1e-5)
    mean = [sum(v[c] for v in vector) / num_robots for c in range(6)]
    logit = dot(mean, p["share"], 0) + float(p["share_bias"][0])
    assert share == pytest.approx(0.4 + 0.7 / (1.0 + math.exp(-logit)), rel=1e-5)


@given(seed=seeds)
@settings(max_examples=10)
def test_tensors_go_the_same_way_as_arrays(seed):
    p, features = random_weights(seed), team_features(team_links(5, seed))
    tensors = {name: torch.tensor(array.astype(np.float64)) for name, array in p.items()}
    as_tensors = TeamFeatures(**{n: torch.from_numpy(a) for n, a in vars(features).items()})
    weights, share = forward(tensors, as_tensors, torch.tanh)
    expected, expected_share = forward(p, features, np.tanh)
    np.testing.assert_allclose(weights.numpy(), expected, rtol=1e-5, atol=1e-6)
    assert float(share) == pytest.approx(expected_share)


@pytest.mark.parametrize("num_robots", [2, 8])
def test_ages_count_in_quarters_of_a_round(num_robots):
    """Without inputs the biases are the weights: 8 robots have 16 half windows, a quarter is 4."""
    p = {name: np.zeros(shape) for name, shape in SHAPES.items()}
    p["weights_bias"] = np.array([3.0, -5.0, 7.0])
    linear, squared, aged, share = network(p)(team_links(num_robots, 1))
    unit = {2: 1.0, 8: 4.0}[num_robots]
    assert np.unique(linear).tolist() == [3.0]
    assert np.unique(squared).tolist() == [-5.0 / unit]
    assert np.unique(aged).tolist() == [7.0 / unit]
    assert share == pytest.approx(0.75)


def test_features_of_a_row_of_three_by_hand():
    """Robots 0 and 2 hear robot 1 alone, over 200 of 250 m."""
    mission = paper("stationary", num_robots=3)
    radio = flooded_team(mission, 0).radio
    links = links_between(radio, np.array([[0.0, 0.0], [200.0, 0.0], [400.0, 0.0]]))
    features = team_features(links)
    log = math.log
    robot = {
        "degree": [log(2) / 2, log(3) / 2, log(2) / 2],
        "closeness": [1.5 / 4, 1 / 4, 1.5 / 4],
        "eccentricity": [2 / 8, 1 / 8, 2 / 8],
        "team_size": [log(3) / 4] * 3,
        "doubt": [0.0] * 3,
        "is_whole": [1.0] * 3,
    }
    row = {
        "downstream": [log(2), log(3), log(2)],
        "hops": [log(2), 0.0, log(2)],
        "is_linked": [1.0, 0.0, 1.0],
        "downstream_share": [2 / 3, 1.0, 2 / 3],
    }
    for name, expected in robot.items():
        assert feature(features, name).tolist() == pytest.approx(expected)
    for name, expected in row.items():
        assert feature(features, name)[1].tolist() == pytest.approx(expected)
    assert feature(features, "distance")[0, 1:].tolist() == pytest.approx([log(1.8), log(2.6)])
    assert features.heard.tolist() == [[0.0, 1.0, 0.0], [0.5, 0.0, 0.5], [0.0, 1.0, 0.0]]


def test_what_is_out_of_reach_has_features_of_order_one():
    """Two robots see each other, believed within a fifth of 100 m; of a third nobody knows."""
    radio = flooded_team(paper("stationary", num_robots=3), 0).radio
    position_m = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 0.0]])
    is_known = np.array([True, True, False])
    spread_m = np.full(3, 20.0 / math.sqrt(2.0))
    features = team_features(links_between(radio, position_m, spread_m, is_known))
    assert feature(features, "doubt").tolist() == pytest.approx([2.0, 2.0, 0.0])
    assert feature(features, "is_whole").tolist() == [0.0] * 3
    assert feature(features, "hops")[0, 2] == pytest.approx(math.log(21.0))
    assert feature(features, "distance")[0, 2] == pytest.approx(math.log(51.0))
    assert not np.any(features.heard[2])
    assert np.max(np.abs(features.pair)) < 5.0
    assert np.max(np.abs(features.robot)) < 5.0


def test_a_vector_of_all_weights_becomes_arrays_in_order():
    flat = np.arange(num_weights(), dtype=np.float64)
    arrays = unpacked(flat)
    assert {name: array.shape for name, array in arrays.items()} == SHAPES
    assert {array.dtype for array in arrays.values()} == {np.dtype(np.float32)}
    np.testing.assert_array_equal(np.concatenate([a.ravel() for a in arrays.values()]), flat)
    network(arrays)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda p: p.pop("share"), "it lacks the tensor share"),
        (lambda p: p.update(wings=np.zeros(2)), "it has an unknown tensor wings"),
        (lambda p: p.update(share=np.zeros(6)), r"tensor share must be \(6, 1\), not \(6,\)"),
        (lambda p: p["own"].__setitem__((2, 3), np.nan), "tensor own has numbers that are not fin"),
        (lambda p: p["pair"].__setitem__((0, 0), -np.inf), "tensor pair has numbers that are not"),
    ],
)
def test_what_is_no_network_is_refused(change, complaint):
    parameters = random_weights()
    change(parameters)
    with pytest.raises(ValueError, match=complaint):
        network(parameters)
