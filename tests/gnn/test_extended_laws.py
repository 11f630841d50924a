"""Laws of the extended features: local, named, finite, and the same under other names."""

import numpy as np
import pytest
from mixed_missions import MISSION, NUM_ROBOTS, SEEDS, flown, mixed_views, renamed

from swarm_mj.gnn.extended_features import ExtendedObserver, LocalObserver


def test_every_feature_is_in_range_and_all_named_here_are_all():
    swarm_views = flown(5)
    observer = ExtendedObserver(MISSION)
    observer.start(len(SEEDS), NUM_ROBOTS)
    for view in swarm_views:
        node = observer.graphs(view).node
        assert node.shape == (len(SEEDS) * NUM_ROBOTS, NUM_ROBOTS, len(observer.names))
        assert np.all((node >= 0.0) & (node <= 2.0))
    assert len(observer.names) == 18


@pytest.mark.parametrize("robot", [0, 4])
def test_eq9_a_graph_rests_on_what_its_robot_can_know(robot):
    """All but its own buffer and the packets it decodes is another team's."""
    observers = [ExtendedObserver(MISSION) for _ in range(2)]
    for observer in observers:
        observer.start(len(SEEDS), NUM_ROBOTS)
    rows = [b * NUM_ROBOTS + robot for b in range(len(SEEDS))]
    num_others = 0
    for pair in zip(*mixed_views(robot), strict=True):
        graphs, same = (o.graphs(view) for o, view in zip(observers, pair, strict=True))
        for name in ("node", "parent", "may_address", "has_turn"):
            np.testing.assert_array_equal(getattr(graphs, name)[rows], getattr(same, name)[rows])
        num_others += np.any(graphs.node != same.node)
    assert num_others > 50


def test_the_local_features_are_the_extended_ones_without_turns():
    extended, local = ExtendedObserver(MISSION), LocalObserver(MISSION)
    kept = [k for k, name in enumerate(extended.names) if "turn" not in name]
    assert local.names == tuple(extended.names[k] for k in kept)
    assert len(local.names) == 13
    for observer in (extended, local):
        observer.start(len(SEEDS), NUM_ROBOTS)
    for view in flown(6):
        graphs, fewer = extended.graphs(view), local.graphs(view)
        np.testing.assert_array_equal(fewer.node, graphs.node[:, :, kept])
        np.testing.assert_array_equal(fewer.may_address, graphs.may_address)
        np.testing.assert_array_equal(fewer.parent, graphs.parent)
        assert not np.any(fewer.has_turn)


def test_names_matter_for_turns_only():
    """A team under other names sees the same, each under its new name, but for whose turn it is."""
    name = np.random.default_rng(1).permutation(NUM_ROBOTS)
    new_name = np.argsort(name)
    one, other = ExtendedObserver(MISSION), ExtendedObserver(MISSION)
    for observer in (one, other):
        observer.start(len(SEEDS), NUM_ROBOTS)
    is_turn = np.array(["turn" in called for called in one.names])
    assert is_turn.sum() == 5
    for view in flown(6):
        node = one.graphs(view).node.reshape(len(SEEDS), NUM_ROBOTS, NUM_ROBOTS, -1)
        same = other.graphs(renamed(view, name, new_name)).node.reshape(node.shape)
        expected = node[:, name][:, :, name]
        np.testing.assert_allclose(same[..., ~is_turn], expected[..., ~is_turn], atol=1e-6)
