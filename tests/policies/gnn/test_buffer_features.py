"""Every feature of the buffer by hand, on one team of four, and laws; times are in windows."""

import math

import numpy as np
import pytest
from mixed_missions import MISSION as WALK
from mixed_missions import flown

from swarm_mj.mission import paper
from swarm_mj.policies.gnn.buffer_features import (
    BufferFeatures,
    count_before,
    length,
    write_lengths,
)
from swarm_mj.policies.gnn.features_of_1_0 import FEATURES_OF_1_0
from swarm_mj.protocol.buffers import NEVER, empty_buffers
from swarm_mj.protocol.window import LocalViews

NOW = 10.0
OBSERVER = 1  # the robot whose row is looked at


def buffers_of_robot_1():
    """It heard of robot 0 at 4 from itself, never of robot 2, of robot 3 at 9 by way of robot 0.

    It last addressed robot 0, at 8. Robot 0 is 50 m off, robot 3 is 350 m off.
    """
    buffers = empty_buffers(1, 4)
    buffers.timestamp[0, OBSERVER] = [4.0, NOW, NEVER, 9.0]
    buffers.position_m[0, OBSERVER] = [[150.0, 0.0], [100.0, 0.0], [0.0, 0.0], [-110.0, -280.0]]
    buffers.velocity_mps[0, OBSERVER] = [[1.0, -3.0], [-1.0, 0.0], [0.0, 0.0], [-1.0, 0.0]]
    buffers.parent[0, OBSERVER] = [1, -1, -1, 0]
    buffers.last_attempt[0, OBSERVER, 0] = 8.0
    return buffers


def seen(buffers, mission=None):
    """The features of each teammate by the name of their place, and whom robot 1 may address.

    The names are those that stored policies know, and none of the code under test: two features
    that change places are both wrong.
    """
    extractor = BufferFeatures(mission or paper("stationary", num_robots=4))
    graphs = extractor.graphs(LocalViews(buffers=buffers, now=np.array([NOW]), phases=()))
    values = graphs.node[OBSERVER].T
    return dict(zip(FEATURES_OF_1_0["buffer"], values, strict=True)), graphs


def log_age(windows):
    return math.log(1 + windows) / math.log(501)


def log_count(count):
    return math.log(1 + count) / math.log(41)


def check(found, expected):
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, rtol=1e-6, err_msg=name)


def test_states_and_ages():
    found, graphs = seen(buffers_of_robot_1())
    check(
        found,
        {
            "is oneself": [0, 1, 0, 0],
            "is known": [1, 1, 0, 1],
            "age of T": [log_age(6), 0, 1, log_age(1)],
            "age of L": [log_age(2), log_age(2), 1, 1],  # its own: of its last packet
            "x, in ranges": [0.2, 0, 0, -0.84],
            "y, in ranges": [0, 0, 0, -1.12],
            "distance": [0.05, 0, 0, 0.35],  # of 4 ranges
            "is in range": [1, 0, 0, 0],
            "P is oneself": [1, 0, 0, 0],
            "v_x": [2 / 3, 0, 0, 0],
            "v_y": [-1, 0, 0, 0],
            "share of the team known": [0.75] * 4,
            "neighbours": [0.1] * 4,
            "size of the team": [0.1] * 4,
        },
    )
    assert graphs.may_address[OBSERVER].tolist() == [True, True, True, False]  # 1.4 ranges are far
    assert graphs.parent[OBSERVER].tolist() == [1, -1, -1, 0]
    assert not graphs.has_turn.any()


def test_who_has_been_silent_for_longer():
    """Robot 1 spoke at 8: robot 0, heard of at 4, is staler; robot 3, at 9, is not."""
    found, _ = seen(buffers_of_robot_1())
    one = log_count(1)
    check(
        found,
        {
            "is staler": [1, 0, 0, 0],
            "rank by T": [0, one, log_count(3), log_count(2)],  # who is unknown comes last
            "staler robots within 0.25 ranges": [one] * 4,
            "staler robots within 0.5 ranges": [one] * 4,
            "staler robots": [one] * 4,
        },
    )


@pytest.mark.parametrize(
    ("ranges", "counts"),
    [(0.24, [1, 1, 1, 1, 1]), (0.4, [0, 1, 1, 1, 1]), (0.9, [0, 0, 1, 1, 1]),
     (1.9, [0, 0, 0, 1, 1]), (2.1, [0, 0, 0, 0, 1])],
)  # fmt: skip
def test_staler_robots_count_by_their_distance(ranges, counts):
    buffers = buffers_of_robot_1()
    buffers.position_m[0, OBSERVER, 0] = [100.0, 250.0 * ranges]
    found, _ = seen(buffers)
    within = ["0.25 ranges", "0.5 ranges", "1 range", "2 ranges"]
    names = [*(f"staler robots within {each}" for each in within), "staler robots"]
    for name, count in zip(names, counts, strict=True):
        assert found[name][OBSERVER] == pytest.approx(log_count(count)), name


def test_robots_that_are_equally_stale_have_the_same_rank():
    """Nothing tells identities apart: those never heard of come last together."""
    buffers = empty_buffers(1, 4)
    buffers.timestamp[0, OBSERVER, OBSERVER] = NOW
    check(seen(buffers)[0], {"rank by T": [log_count(1), 0, log_count(1), log_count(1)]})


def test_other_identities_are_the_same_graph():
    """The features of renamed robots are the renamed features: there is no order of identities."""
    views = flown(0)[-1]
    order = np.random.default_rng(0).permutation(views.num_robots)
    extractor = BufferFeatures(WALK)
    node = extractor.graphs(views).node.reshape(*views.buffers.timestamp.shape, -1)
    renamed = extractor.graphs(_renamed(views, order)).node.reshape(node.shape)
    np.testing.assert_array_equal(renamed, node[:, order][:, :, order])


def _renamed(views, order):
    buffers, place = views.buffers, np.argsort(order)
    pairs = {
        name: getattr(buffers, name)[:, order][:, :, order]
        for name in ("timestamp", "position_m", "velocity_mps", "parent", "last_attempt")
    }
    parent = pairs["parent"]
    pairs["parent"] = np.where(parent < 0, parent, place[parent]).astype(parent.dtype)
    return LocalViews(
        buffers=type(buffers)(**pairs, is_granted=buffers.is_granted), now=views.now, phases=()
    )


def whole_arrays(views, mission):
    """All features and who may be addressed, one whole array after the other, in no hurry."""
    buffers = views.buffers
    oneself = np.eye(views.num_robots, dtype=bool)
    known = buffers.is_known | oneself
    spoke = buffers.last_attempt.max(axis=2, keepdims=True)
    staler = known & ~oneself & (buffers.timestamp < spoke)
    since = np.where(oneself, spoke, np.where(known, buffers.timestamp, np.inf))
    rank = np.sum(since[:, :, None, :] < since[:, :, :, None], axis=3)
    attempt = np.where(oneself, spoke, buffers.last_attempt)
    own_m = np.einsum("biix->bix", buffers.position_m)[:, :, None]
    own_mps = np.einsum("biix->bix", buffers.velocity_mps)[:, :, None]
    place = (buffers.position_m - own_m) * (known[..., None] * (1.0 / mission.range_m))
    speed = (buffers.velocity_mps - own_mps) * (known[..., None] * (1.0 / mission.max_velocity_mps))
    ranges = np.hypot(place[..., 0], place[..., 1])
    near = known & ~oneself & (ranges <= 1.0)
    distance = (np.minimum(ranges, 4.0) / 4.0).astype(np.float32)

    def ages(then, is_granted):
        age = np.minimum(views.now[:, None, None] - then, 500.0)
        return np.where((then > NEVER) | is_granted, np.log1p(age) / np.log1p(500.0), 1.0)

    def counts(is_counted, log=True):
        number = is_counted.sum(axis=2, keepdims=True)
        return np.log1p(number) / np.log1p(40.0) if log else number

    columns = {
        "is oneself": oneself[None],
        "is known": known,
        "age of T": ages(buffers.timestamp, known),
        "age of L": ages(attempt, False),
        "x, in ranges": np.clip(place[..., 0], -4.0, 4.0),
        "y, in ranges": np.clip(place[..., 1], -4.0, 4.0),
        "distance": distance,
        "is in range": near,
        "P is oneself": known & ~oneself & (buffers.parent == np.arange(views.num_robots)[:, None]),
        "v_x": speed[..., 0],
        "v_y": speed[..., 1],
        "is staler": staler,
        "rank by T": np.log1p(rank) / np.log1p(40.0),
        "share of the team known": counts(known, log=False) / views.num_robots,
        "neighbours": counts(near, log=False) / 10.0,
        "size of the team": np.array([[[views.num_robots / 40.0]]]),
        "staler robots within 0.25 ranges": counts(staler & (4.0 * distance <= 0.25)),
        "staler robots within 0.5 ranges": counts(staler & (4.0 * distance <= 0.5)),
        "staler robots within 1 range": counts(staler & (4.0 * distance <= 1.0)),
        "staler robots within 2 ranges": counts(staler & (4.0 * distance <= 2.0)),
        "staler robots": counts(staler),
    }
    assert tuple(columns) == FEATURES_OF_1_0["buffer"]
    shape = known.shape
    node = [np.broadcast_to(each, shape).astype(np.float32) for each in columns.values()]
    rows = (-1, views.num_robots)
    may_address = ~known | (distance <= np.float32(0.3))
    return np.stack(node, axis=-1).reshape(*rows, len(columns)), may_address.reshape(rows)


@pytest.mark.parametrize("seed", [0, 1])
def test_one_pass_writes_what_whole_arrays_say(seed):
    """In the one pass an age is looked up, and its logarithm may round otherwise."""
    extractor = BufferFeatures(WALK)
    for views in flown(seed):
        graphs = extractor.graphs(views)
        node, may_address = whole_arrays(views, WALK)
        is_age = np.array(["age" in name for name in FEATURES_OF_1_0["buffer"]])
        np.testing.assert_array_equal(graphs.node[..., ~is_age], node[..., ~is_age])
        np.testing.assert_array_max_ulp(graphs.node[..., is_age], node[..., is_age], 1, np.float32)
        np.testing.assert_array_equal(graphs.may_address, may_address)


def test_lengths_are_those_of_hypot_in_single_precision():
    """Also halfway between two of its numbers, where a last bit decides, and next to the range."""
    rng = np.random.default_rng(0)
    below = rng.uniform(0.0, 4.0, 5_000).astype(np.float32)
    halfway = (below.astype(np.float64) + np.nextafter(below, np.float32(5.0))) / 2.0
    next_to_range = 1.0 + rng.integers(-3, 4, 5_000) * 2.0**-53
    lengths = np.concatenate([rng.uniform(0.0, 5.0, 5_000), halfway, next_to_range, [0.0, 1.0]])
    angle = rng.uniform(0.0, 2.0 * np.pi, lengths.size)
    x = lengths * np.cos(angle)
    y = lengths * np.sin(angle)
    found = np.array([length(*place) for place in zip(x.tolist(), y.tolist(), strict=True)])
    at_once = np.empty_like(x)
    write_lengths(x, y, at_once)
    np.testing.assert_array_equal(at_once, found)
    clear = x[:1], y[:1]  # where no length is looked at twice
    write_lengths(*clear, at_once[:1])
    np.testing.assert_array_equal(
        at_once[:1].astype(np.float32), np.hypot(*clear).astype(np.float32)
    )
    np.testing.assert_array_equal(found.astype(np.float32), np.hypot(x, y).astype(np.float32))
    np.testing.assert_array_equal(found <= 1.0, np.hypot(x, y) <= 1.0)


def test_equal_times_have_the_same_rank():
    times = np.array([3.0, 1.0, np.inf, 1.0, np.inf])
    num_before = np.empty(5)
    count_before(times, num_before)
    assert num_before.tolist() == [2, 0, 3, 0, 3]
