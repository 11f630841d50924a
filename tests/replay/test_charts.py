"""Tree, age matrix, state lanes and plots, against plain loops."""

import numpy as np
import pytest
from reading import column, rows, static

from swarm_mj.replay.charts import dendrogram, plots, radio_states
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
    place = dendrogram(parent, is_known, 0)[0]
    np.testing.assert_array_equal(place[:5, 0], [0, 1, 1, 2, 2])
    np.testing.assert_allclose(place[[1, 3, 4], 1], [0.0, 0.5, 1.0])
    np.testing.assert_allclose(place[2, 1], 0.75)  # amid 3 and 4
    np.testing.assert_allclose(place[0, 1], 0.375)  # amid 1 and 2
    assert np.all(np.isnan(place[5]))
    lone = dendrogram(parent, np.arange(6)[None] == 1, 1)[0]
    np.testing.assert_array_equal(lone[1], [0.0, 0.5])


def test_edges_lead_from_hop_to_hop_and_no_two_robots_share_a_place(replay, two_way):
    log = two_way.log
    is_known = ~np.isnan(log.known_age)
    known = dendrogram(log.parent, is_known, log.ego)[-1][is_known[-1]]
    assert len(np.unique(known, axis=0)) == len(known)
    strips = rows(replay, "/tree/edges", "LineStrips2D:strips", 2, 2)
    assert len(strips) == np.sum(log.has_parent)
    hops = strips[:, 1, 0] - strips[:, 0, 0]
    np.testing.assert_allclose(hops, hops[0], rtol=1e-4)
    assert hops[0] > 0.0


@pytest.mark.parametrize(
    ("flight", "names"),
    [("two_way", ["delivered", "lost", "overheard", "answered"]), ("flooded", ["sent", "heard"])],
)
def test_the_packet_plot_counts_as_the_costs_do(flight, names, request):
    recorded = request.getfixturevalue(flight)
    _, plot, *_ = plots(recorded.log)
    assert [curve.entity.path for curve in plot.curves] == [f"plots/radio/{name}" for name in names]
    for curve, name in zip(plot.curves, names, strict=True):
        counts = recorded.counted(name)
        expected = [sum(counts[max(0, t - 9) : t + 1]) for t in range(len(counts))]
        np.testing.assert_array_equal(curve.values, expected)


def test_the_plot_of_the_world_has_shares_of_links_and_robots(blocked, blocked_replay):
    log = blocked.log
    expected = {"believed, too weak": [], "works, unbelieved": [], "cut off from r4": []}
    weak, works, cut_off = expected.values()
    for window in log.mismatch.window.tolist():
        where, is_weak = log.position_m[window - 1], log.mismatch.at(window)["is_too_weak"]
        num_near = sum(
            np.linalg.norm(where[i] - where[j]) <= 250.0 for i in range(14) for j in range(i)
        )
        num_weak = is_weak.tolist().count(True)
        num_extra = len(is_weak) - num_weak
        weak.append(100.0 * num_weak / num_near)
        works.append(100.0 * num_extra / (num_near - num_weak + num_extra))
        cut_off.append(100.0 * log.is_cut_off[window - 1].tolist().count(True) / 13)
    shares = {curve.name: curve.values for curve in plots(log)[2].curves}
    for name, values in expected.items():
        np.testing.assert_allclose(shares[name], values)
    shown = column(blocked_replay, "/plots/world/cut_off_from_r4", "Scalars:scalars")
    np.testing.assert_allclose(shown.flatten().to_numpy(), cut_off)


def test_plots_are_the_costs(replay, two_way):
    shown = column(replay, "/plots/task/cost", "Scalars:scalars").flatten().to_numpy()
    np.testing.assert_allclose(shown, two_way.log.velocity_variance_m2ps2, rtol=1e-12)
    values = column(replay, "/plots/age/mean", "Measurements:values").flatten().to_numpy()
    np.testing.assert_allclose(values, two_way.log.age_mean, rtol=1e-6)
