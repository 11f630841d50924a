"""Tree, age matrix and state lanes, against plain loops."""

import numpy as np
import pytest
from reading import rows, static

from swarm_mj.replay.charts import dendrogram, radio_states
from swarm_mj.replay.palette import age_colours


@pytest.mark.parametrize("flight", ["two_way", "flooded"])
def test_states_follow_a_plain_reading_of_the_log(flight, request):
    log = request.getfixturevalue(flight).log
    states = radio_states(log)
    assert len(np.unique(states)) == (3 if log.facts.is_broadcast else 5)
    for t, i in np.ndindex(len(log.window), 12):
        is_heard, (to, answered) = np.any(log.heard[t, :, i] != i), log.recipient[t, :, i]
        if log.facts.is_broadcast:
            expected = "hears" if is_heard else "silent"
            expected = "transmits" if to != i or answered != i else expected
        elif to != i:
            expected = "delivers" if log.heard[t, 0, to] == i else "is lost"
        else:
            expected = "overhears" if is_heard else "silent"
            expected = "answers" if answered != i else expected
        assert states[t, i] == expected


@pytest.mark.parametrize(("name", "flight"), [("replay", "two_way"), ("flood_replay", "flooded")])
def test_each_robot_has_a_row_and_each_state_its_name(name, flight, request):
    path, log = request.getfixturevalue(name), request.getfixturevalue(flight).log
    context = static(path, "/state", "AnnotationContext:context")
    names = np.array([each["class_description"]["info"]["label"] for each in context])
    shown = static(path, "/state", "SegmentationImage:buffer").reshape(12, len(log.window))
    np.testing.assert_array_equal(names[shown].T, radio_states(log))


def test_a_line_marks_the_window_that_is_shown(replay, two_way):
    ends = rows(replay, "/state/now", "LineStrips2D:strips", 2, 2)
    k = np.arange(len(two_way.log.window))
    np.testing.assert_array_equal(ends[:, 0, 0], k + 0.5)  # amid the pixels of each
    np.testing.assert_array_equal(ends[:, 1], np.stack([k + 0.5, np.full(len(k), 12)], axis=1))


def test_rows_of_the_matrix_own_and_columns_are_owned(replay, two_way):
    """The ego robot's row, wherever the walk put it, is what the ego robot knows."""
    log, full_scale = two_way.log, two_way.log.facts.full_scale
    shades = rows(replay, "/ages", "SegmentationImage:buffer", 12, 12)
    a_shade = full_scale / 255.0
    # Rows and columns are permuted alike, so that the ages agree as a set.
    shown, ages = (np.sort(x.reshape(len(shades), -1), axis=1) for x in (shades, log.age))
    expected = np.minimum(ages, full_scale)
    np.testing.assert_allclose(shown * a_shade, expected, atol=0.51 * a_shade)
    in_rows = np.sort(shades[-1], axis=1).tolist()
    in_columns = np.sort(shades[-1].T, axis=1).tolist()
    own, about = (
        np.sort(np.rint(np.minimum(age, full_scale) / a_shade)).tolist()
        for age in (log.ego_age[-1], log.age[-1, :, log.ego])
    )
    assert own in in_rows
    assert about not in in_rows
    assert about in in_columns


def test_the_matrix_wears_the_colours_of_the_map(replay, two_way):
    context = static(replay, "/ages", "AnnotationContext:context")
    named = [each["class_description"]["info"] for each in context]
    full_scale = two_way.log.facts.full_scale
    assert named[0]["label"] == "0 windows"
    assert named[-1]["label"] == f"{full_scale:g} windows or more"
    rgb = [(each["color"] >> shift) & 255 for each in named for shift in (24, 16, 8)]
    ages = np.linspace(0.0, full_scale, len(named))
    np.testing.assert_array_equal(np.reshape(rgb, (-1, 3)), age_colours(ages, full_scale))


def test_a_small_tree_by_hand():
    # 0 - 1, 0 - 2, 2 - 3, 2 - 4; 5 is unknown. Leaves from the top: 1, 3, 4.
    parent = np.array([[-1, 0, 0, 2, 2, -1]], dtype=np.int32)
    is_known = np.array([[True, True, True, True, True, False]])
    tree = dendrogram(parent, is_known, 0)
    np.testing.assert_array_equal(tree.hops[0], [0, 1, 1, 2, 2, np.nan])
    # 0 stands amid 1 and 2, and 2 amid 3 and 4.
    np.testing.assert_allclose(tree.height[0], [0.375, 0.0, 0.75, 0.5, 1.0, np.nan])
    lone = dendrogram(parent, np.arange(6)[None] == 1, 1)
    assert (lone.hops[0, 1], lone.height[0, 1]) == (0.0, 0.5)


def test_edges_lead_from_hop_to_hop_and_no_two_robots_share_a_place(replay, two_way):
    log = two_way.log
    is_known = ~np.isnan(log.known_age)
    tree = dendrogram(log.parent, is_known, log.ego)
    known = np.stack([tree.hops[-1], tree.height[-1]], axis=1)[is_known[-1]]
    assert len(np.unique(known, axis=0)) == len(known)
    strips = rows(replay, "/tree/edges", "LineStrips2D:strips", 2, 2)
    assert len(strips) == np.sum(log.has_parent)
    hops = strips[:, 1, 0] - strips[:, 0, 0]
    np.testing.assert_allclose(hops, hops[0], rtol=1e-4)
    assert hops[0] > 0.0
