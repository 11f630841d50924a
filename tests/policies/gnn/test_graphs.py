"""The paper's and the authors' features by hand on four robots' buffers; laws over every set."""

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.gnn.feature_sets import FEATURE_SETS, make_extractor
from swarm_mj.policies.gnn.graphs import PaperFeatures, ReferenceFeatures
from swarm_mj.policies.random_access import RandomFlooding
from swarm_mj.protocol.buffers import NO_PARENT, Buffers, empty_buffers
from swarm_mj.protocol.window import LocalViews, Phase
from swarm_mj.simulation.swarm import Swarm

# 4 robots at 40 per km²: a side of sqrt(0.1) km; 200 windows of 0.1 s: 20 s.
MISSION = paper("stationary", num_robots=4, num_windows=200)
SIDE_M, DURATION_S = 316.2277660168, 20.0


def views_of_robot_1():
    """At t = 50, robot 1 heard of robot 0 at t = 20 and never of robots 2 and 3; it addressed 2."""
    buffers = empty_buffers(1, 4)
    buffers.timestamp[0, 1, :2] = [20.0, 50.0]
    buffers.position_m[0, 1, :2] = [[-100.0, 40.0], [60.0, -20.0]]
    buffers.velocity_mps[0, 1, :2] = [[1.0, -2.0], [0.5, 0.25]]
    buffers.parent[0, 1, 0] = 3
    buffers.last_attempt[0, 1, 2] = 30.5
    return LocalViews(buffers=buffers.read_only(), now=np.array([50.0]), phases=())


def started(extractor, num_missions=1, num_robots=4):
    extractor.start(num_missions, num_robots)
    return extractor


def test_iii_a_the_papers_features_by_hand():
    graphs = started(PaperFeatures(MISSION)).graphs(views_of_robot_1())
    per_side = 1.0 / SIDE_M
    moved = DURATION_S / SIDE_M
    expected = [
        [0.0, 1.0, 0.1, -100 * per_side, 40 * per_side, 1.0 * moved, -2.0 * moved, 0.0],
        [1.0, 1.0, 0.25, 60 * per_side, -20 * per_side, 0.5 * moved, 0.25 * moved, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1525],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    ]
    np.testing.assert_allclose(graphs.node[1], expected, rtol=1e-6)
    assert PaperFeatures.names[:3] == ("is oneself", "is known", "T")


def test_the_codes_features_by_hand():
    """Constants included: 500 windows, 1000 m; unknown robots stand in the middle since t = 0."""
    graphs = started(ReferenceFeatures(MISSION)).graphs(views_of_robot_1())
    expected = [
        [-0.06, 0.0, -0.16, 0.06, 0.0005, -0.00225, -0.1],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.1],
        [-0.1, 0.0, -0.06, 0.02, -0.0005, -0.00025, -0.039],
        [-0.1, 0.0, -0.06, 0.02, -0.0005, -0.00025, -0.1],
    ]
    np.testing.assert_allclose(graphs.node[1], expected, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("features", ["paper", "reference"])
def test_the_edges_are_the_parents_and_anyone_may_be_addressed(features):
    graphs = started(make_extractor(features, MISSION)).graphs(views_of_robot_1())
    assert graphs.parent.tolist()[1] == [3, NO_PARENT, NO_PARENT, NO_PARENT]
    assert np.all(graphs.may_address)
    assert not np.any(graphs.has_turn)


@pytest.mark.parametrize("features", FEATURE_SETS)
def test_rows_are_robots_mission_by_mission(features):
    """Row b N + i is what robot i of mission b sees, as if its mission were alone."""
    together, talk = Swarm(MISSION, [1, 2, 3]), RandomFlooding(0.3)
    together.start(talk)
    extractor = started(make_extractor(features, MISSION), num_missions=3)
    alone = started(make_extractor(features, MISSION))
    for window in range(8):
        graphs, views = extractor.graphs(together.views), together.views
        buffers = Buffers(**{name: rows[1:2] for name, rows in vars(views.buffers).items()})
        phases = tuple(Phase(*(rows[1:2] for rows in phase)) for phase in views.phases)
        own = LocalViews(buffers=buffers, now=views.now[1:2], phases=phases)
        expected = alone.graphs(own)
        for name in ("node", "parent", "may_address", "has_turn"):
            rows = getattr(graphs, name)
            assert len(rows) == 12
            np.testing.assert_array_equal(rows[4:8], getattr(expected, name), err_msg=str(window))
        together.step(talk)
