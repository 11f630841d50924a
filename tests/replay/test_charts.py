"""What the charts show, against plain loops."""

import numpy as np
from reading import column, rows_of_strips

from swarm_mj.mission.geometry import spanning_tree
from swarm_mj.replay.charts import (
    packet_counts,
    radio_states,
    rate,
    surprise_shares,
    walk,
)
from swarm_mj.replay.links import fates

FATES = ["delivered", "lost", "overheard", "answered"]


def test_a_walk_visits_everyone_once_and_children_after_parents(two_way):
    parent = spanning_tree(two_way.log.position_m[:1])[0]
    order = walk(parent).tolist()
    assert sorted(order) == list(range(len(parent)))
    for j, k in enumerate(parent):
        if k >= 0:
            assert order.index(k) < order.index(j)


def test_the_rate_counts_the_last_ten_windows():
    counts = np.arange(25)
    np.testing.assert_array_equal(
        rate(counts), [sum(counts[max(0, t - 9) : t + 1]) for t in range(25)]
    )


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


def test_the_packet_plot_counts_as_the_costs_do(two_way, flooded):
    for recorded, curves in ((two_way, FATES), (flooded, ["sent", "heard"])):
        counts = packet_counts(recorded.log, fates(recorded.log))
        assert list(counts) == list(curves)
        for name, (_, per_window) in counts.items():
            np.testing.assert_array_equal(per_window, recorded.counted(name))


def test_the_plot_of_the_world_has_shares_of_links_and_robots(blocked, blocked_replay):
    log = blocked.log
    expected = {"believed, too weak": [], "works, unbelieved": [], "cut off from r4": []}
    weak, works, cut_off = expected.values()
    for window in log.looks.window.tolist():
        where, seen = log.position_m[window - 1], log.looks.at(window)
        num_near = sum(
            np.linalg.norm(where[i] - where[j]) <= 250.0 for i in range(14) for j in range(i)
        )
        num_weak = seen.is_too_weak.tolist().count(True)
        num_extra = len(seen.row) - num_weak
        weak.append(100.0 * num_weak / num_near)
        works.append(100.0 * num_extra / (num_near - num_weak + num_extra))
        team = log.group[window - 1].tolist()
        cut_off.append(100.0 * sum(of != team[4] for of in team) / 13)
    shares = surprise_shares(log, log.looks)
    for name, values in expected.items():
        np.testing.assert_allclose(shares[name][1], values)
    shown = column(blocked_replay, "/plots/world/cut_off_from_r4", "Scalars:scalars")
    np.testing.assert_allclose(shown.flatten().to_numpy(), cut_off)


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


def test_plots_are_the_costs(replay, two_way):
    shown = column(replay, "/plots/task/cost", "Scalars:scalars").flatten().to_numpy()
    np.testing.assert_allclose(shown, two_way.log.velocity_variance_m2ps2, rtol=1e-12)
    values = column(replay, "/plots/age/mean", "Measurements:values").flatten().to_numpy()
    np.testing.assert_allclose(values, two_way.log.age_mean, rtol=1e-6)


def test_the_tree_s_lines_join_nodes_a_hop_apart(replay, two_way):
    strips = rows_of_strips(replay, "/tree/edges")
    known = two_way.log.is_known & (np.arange(12) != two_way.log.ego)
    assert len(strips) == np.sum(known)
    hop = np.unique(np.round(strips[:, 1, 0] - strips[:, 0, 0], 3))
    assert len(hop) == 1
    assert hop[0] > 0
