import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import pdist, squareform
from spatial_rule import agreed_senders, radio

from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.spatial_tdma import SpatialTdma
from swarm_mj.policies.tdma import Tdma
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.protocol.window import SLOT_WINDOWS
from swarm_mj.simulation.swarm import Swarm

MISSION = paper("stationary", num_robots=20)


def views_of(position_m, is_known, half=0):
    """Views of one mission in which robot i believes j at position_m[j], if it knows of it."""
    num_robots = len(position_m)
    buffers = empty_buffers(1, num_robots)
    buffers.position_m[:] = position_m
    buffers.timestamp[:] = is_known
    return LocalViews(buffers=buffers, now=np.array([half * SLOT_WINDOWS]), phases=())


def senders(policy, views):
    """Who broadcasts in the one mission."""
    return set(np.flatnonzero(policy.transmits(views)[0]).tolist())


def on_a_line(x_m, half, threshold=1.0):
    """Who broadcasts of four that know where everyone is, in the order of their identities."""
    policy = SpatialTdma(range_m=250.0, threshold=threshold)
    policy.start(4, [np.random.default_rng(0)])
    policy._order = np.arange(4)[None]
    position_m = np.stack([x_m, np.zeros(4)], axis=1)
    return senders(policy, views_of(position_m, True, half))


def test_two_pairs_far_apart_speak_at_once_by_hand():
    """Robots at 0, 100, 1000 and 1100 m, range 250 m, threshold 1.

    In turn 0 robot 2 joins robot 0: robot 1 decodes (250/100)² = 6.25 against 1 + (250/900)², and
    robot 3 gains. In turn 1 robot 3 is asked first, in turn 2 robot 0, in turn 3 robot 1.
    """
    apart_m = [0.0, 100.0, 1000.0, 1100.0]
    assert [on_a_line(apart_m, half) for half in range(5)] == [
        {0, 2},
        {1, 3},
        {0, 2},
        {1, 3},
        {0, 2},
    ]


def test_nobody_joins_who_would_take_a_packet_from_somebody_by_hand():
    """At 0, 240, 500 and 600 m robot 1 decodes robot 0 at (250/240)² = 1.09, and needs 1.92 beside
    robot 2, 260 m off, or 1.48 beside robot 3, 360 m off."""
    assert on_a_line([0.0, 240.0, 500.0, 600.0], half=0) == {0}


def test_nobody_joins_whom_nobody_would_hear_by_hand():
    """Robot 2 is 2 km from all others: in turn 0 its packet would be of no use."""
    assert on_a_line([0.0, 100.0, 2000.0, 50.0], half=0) == {0}


def test_a_sender_is_no_listener_to_gain_by_hand():
    """At 0, 260, 460 and 560 m robot 2 joins robot 0, for robot 3. Robot 1 decodes neither:
    (250/200)² = 1.56 against 1 + (250/260)². Only robot 2 could decode it, and is sending."""
    assert on_a_line([0.0, 260.0, 460.0, 560.0], half=0) == {0, 2}


def test_threshold_counts_by_hand():
    """At 0, 100, 300 and 400 m with threshold h, packets at the range arrive h above the noise.

    Robot 1 decodes (250/100)² = 6.25 of them against 1 + h (250/200)² beside robot 2: up to
    h = 3.36. Beside robot 3 it needs 1 + h (250/300)², which is 3.78 at h = 4.
    """
    near_m = [0.0, 100.0, 300.0, 400.0]
    assert on_a_line(near_m, half=0, threshold=1.0) == {0, 2}
    assert on_a_line(near_m, half=0, threshold=3.3) == {0, 2}
    assert on_a_line(near_m, half=0, threshold=4.0) == {0, 3}


@given(
    seed=st.integers(0, 2**32 - 1),
    num_robots=st.integers(2, 25),
    threshold=st.sampled_from([0.3, 1.25, 4.0]),
)
def test_eq3_robots_that_know_all_decide_by_the_rule_and_the_others_wait(
    seed, num_robots, threshold
):
    """The radio judges; half of the robots do not know one of the others."""
    rng = np.random.default_rng(seed)
    position_m = rng.uniform(-500, 500, size=(num_robots, 2))
    is_known = np.ones((num_robots, num_robots))
    ignorant = rng.permutation(num_robots)[: num_robots // 2]
    is_known[ignorant, (ignorant + rng.integers(1, num_robots)) % num_robots] = 0
    policy = SpatialTdma(range_m=250.0, threshold=threshold)
    policy.start(num_robots, [rng])
    (order,) = policy._order
    half = int(rng.integers(0, 100))
    agreed = agreed_senders(order, half, position_m, radio(250.0, threshold))
    expected = (agreed - set(ignorant.tolist())) | {order[half % num_robots]}
    assert senders(policy, views_of(position_m, is_known, half)) == expected


def test_robots_that_believe_otherwise_decide_otherwise():
    """Robot 2 believes all others near: it keeps silent where the robots at 1000 m would speak."""
    policy = SpatialTdma(range_m=250.0, threshold=1.0)
    policy.start(4, [np.random.default_rng(0)])
    policy._order = np.arange(4)[None]
    apart_m = np.array([[0.0, 0.0], [100.0, 0.0], [1000.0, 0.0], [1100.0, 0.0]])
    views = views_of(apart_m, True)
    assert senders(policy, views) == {0, 2}
    views.buffers.position_m[0, 2] = [[150.0, 0.0], [50.0, 0.0], [0.0, 0.0], [100.0, 0.0]]
    assert senders(policy, views) == {0}


def test_who_knows_nobody_does_as_tdma_does():
    """From an empty start the same order is spoken in, one robot a half window."""
    spatial, plain = SpatialTdma(range_m=250.0, threshold=1.25), Tdma()
    for policy in (spatial, plain):
        policy.start(20, [np.random.default_rng(4)])
    position_m = Swarm(MISSION, [1]).states.position_m[0]
    for half in range(45):
        views = views_of(position_m, np.eye(20), half)
        assert senders(spatial, views) == senders(plain, views)
        assert len(senders(spatial, views)) == 1


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_team_at_rest_loses_nothing_and_gains_by_joining(seed):
    """From the start on all in range decode the owner; so nobody's knowledge is ever older than
    under plain TDMA in the same order, and in the end it is younger."""
    swarms = Swarm(MISSION, [seed]), Swarm(MISSION, [seed])
    spatial, plain = make_policy("spatial-tdma", MISSION), Tdma()
    distance_m = squareform(pdist(swarms[0].states.position_m[0]))
    is_near = (distance_m <= MISSION.range_m) & ~np.eye(20, dtype=bool)
    for window in range(150):
        swarms[0].step(spatial)
        swarms[1].step(plain)
        for half, phase in enumerate(swarms[0].phases):
            owner = spatial._order[0, (2 * window + half) % 20]
            assert np.all(phase.heard[0, is_near[owner]] == owner)
        assert np.all(swarms[0].buffers.timestamp >= swarms[1].buffers.timestamp)
    assert np.any(swarms[0].buffers.timestamp > swarms[1].buffers.timestamp)
