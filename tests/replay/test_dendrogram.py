"""The drawing of a parent tree, against a tree drawn by hand and a plain walk."""

import numpy as np

from swarm_mj.replay.dendrogram import dendrogram


def test_a_small_tree_by_hand():
    # 0 - 1, 0 - 2, 2 - 3, 2 - 4; 5 is unknown. Leaves from the top: 1, 3, 4.
    parent = np.array([[-1, 0, 0, 2, 2, -1]], dtype=np.int32)
    is_known = np.array([[True, True, True, True, True, False]])
    place = dendrogram(parent, is_known, 0)[0]
    np.testing.assert_array_equal(place[:5, 0], [0, 1, 1, 2, 2])
    np.testing.assert_allclose(place[[1, 3, 4], 1], [0.0, 0.5, 1.0])
    np.testing.assert_allclose(place[2, 1], 0.75)  # amid 3 and 4
    np.testing.assert_allclose(place[0, 1], 0.375)  # amid 1 and 2
    assert np.all(np.isnan(place[5]))


def test_a_lone_observer_stands_in_the_middle():
    place = dendrogram(np.full((1, 3), -1, dtype=np.int32), np.array([[False, True, False]]), 1)
    np.testing.assert_array_equal(place[0, 1], [0.0, 0.5])


def test_depth_is_the_number_of_hops_to_the_observer(two_way):
    log = two_way.log
    place = dendrogram(log.parent, log.is_known, log.ego)
    for t in range(len(log.window)):
        for j in np.flatnonzero(log.is_known[t]):
            hops, at = 0, j
            while at != log.ego:
                at = log.parent[t, at]
                hops += 1
            assert place[t, j, 0] == hops


def test_no_two_robots_share_a_place(two_way):
    log = two_way.log
    place = dendrogram(log.parent, log.is_known, log.ego)[-1]
    known = place[~np.isnan(place[:, 0])]
    assert len(np.unique(known, axis=0)) == len(known) == np.sum(log.is_known[-1])
