"""Plots against plain counts and the costs."""

import numpy as np
import pytest
from reading import column

from swarm_mj.replay.plots import plots


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
