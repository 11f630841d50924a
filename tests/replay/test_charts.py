"""What the tree, the age matrix and the state lanes show, against plain loops."""

import numpy as np
from reading import column, rows_of_strips

from swarm_mj.mission.geometry import spanning_tree
from swarm_mj.replay.charts import dendrogram, radio_states, walk


def test_a_walk_visits_everyone_once_and_children_after_parents(two_way):
    parent = spanning_tree(two_way.log.position_m[:1])[0]
    order = walk(parent).tolist()
    assert sorted(order) == list(range(len(parent)))
    for j, k in enumerate(parent):
        if k >= 0:
            assert order.index(k) < order.index(j)


def test_states_follow_a_plain_reading_of_the_log(two_way):
    log = two_way.log
    states, state = radio_states(log)
    names = list(states)
    for t in range(len(log.window)):
        for i in range(log.recipient.shape[2]):
            (to, _), (first, second) = log.recipient[t, :, i], log.heard[t, :, i]
            expected = "silent"
            if first != i or second != i:
                expected = "overhears"
            if log.recipient[t, 1, i] != i:
                expected = "answers"
            if to != i:
                expected = "delivers" if log.heard[t, 0, to] == i else "is lost"
            assert names[state[t, i]] == expected


def test_a_broadcasting_robot_transmits_hears_or_is_silent(flooded):
    log = flooded.log
    states, state = radio_states(log)
    names = list(states)
    assert len(names) == 3
    for t, i in np.ndindex(len(log.window), 12):
        expected = "hears" if np.any(log.heard[t, :, i] != i) else "silent"
        if np.any(log.recipient[t, :, i] != i):
            expected = "transmits"
        assert names[state[t, i]] == expected


def test_rows_of_the_matrix_own_and_columns_are_owned(replay, two_way):
    """The ego robot's row, wherever the walk put it, is what the ego robot knows."""
    tensors = column(replay, "/ages", "Tensor:data").flatten().to_pylist()
    shown = np.array(tensors[-1]["buffer"]).reshape(12, 12)
    full_scale = shown.max()
    own = np.sort(np.minimum(two_way.log.ego_age[-1], full_scale)).astype(np.float16)
    about = np.minimum(two_way.log.age[-1, :, two_way.log.ego], full_scale)
    assert any(np.array_equal(np.sort(row), own) for row in shown)
    assert any(np.array_equal(np.sort(owned), np.sort(about)) for owned in shown.T)
    assert not any(np.array_equal(np.sort(row), np.sort(about)) for row in shown)


def test_the_matrix_holds_every_pair_s_age(replay, two_way):
    tensors = column(replay, "/ages", "Tensor:data").flatten()
    shown = np.stack([np.array(tensor["buffer"]) for tensor in tensors.to_pylist()])
    expected = two_way.log.age.reshape(len(shown), -1)
    full_scale = shown.max()
    # Rows and columns are permuted alike, so the ages agree as a set.
    np.testing.assert_array_equal(
        np.sort(shown, axis=1), np.sort(np.minimum(expected, full_scale), axis=1)
    )


def test_the_tree_s_lines_join_nodes_a_hop_apart(replay, two_way):
    strips = rows_of_strips(replay, "/tree/edges")
    known = two_way.log.is_known & (np.arange(12) != two_way.log.ego)
    assert len(strips) == np.sum(known)
    hop = np.unique(np.round(strips[:, 1, 0] - strips[:, 0, 0], 3))
    assert len(hop) == 1
    assert hop[0] > 0


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
