from dataclasses import replace

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.costs import WindowCosts, mean_hops
from swarm_mj.protocol.packet_counts import COUNTS, no_packets
from swarm_mj.simulation.rollout import WindowRecord, rollout, summarise
from swarm_mj.simulation.swarm import Swarm

ADDRESSED = ("attempted", "delivered", "lost", "overheard", "answered")
TRANSMITTED = np.array([4.0, 2.0])  # in each window


def flown_by_hand(age, variance, is_complete, hops, packets):
    """One window of two missions; packets: attempted, delivered, lost, overheard, answered."""
    counts = no_packets(2)
    counts["transmitted"] = TRANSMITTED
    for name, count in zip(ADDRESSED, packets, strict=True):
        counts[name] = count
    counts["sent"] = counts["attempted"]
    costs = WindowCosts(
        age_windows=np.array(age),
        is_complete=np.array(is_complete),
        velocity_variance_m2ps2=np.array(variance),
        counts=counts,
    )
    return WindowRecord(costs=costs, hops=np.array(hops))


def broadcast_by_hand(window, packets):
    """The same window with broadcasts in its first phase: sent, heard, receptions."""
    counts = np.full(2, np.nan, COUNTS)
    counts["sent"], counts["heard"], counts["receptions"] = packets
    counts["transmitted"] = counts["sent"]
    return replace(window, costs=window.costs._replace(counts=counts))


THREE_WINDOWS = [
    flown_by_hand(
        [1.0, 0.5], [9.0, 4.0], [False, False], [0.0, 1.0], ([3, 1], [1, 0], [2, 1], [2, 0], [1, 0])
    ),
    flown_by_hand(
        [2.0, 1.0], [6.0, 5.0], [True, False], [1.5, 1.0], ([2, 2], [2, 1], [0, 1], [0, 4], [0, 1])
    ),
    flown_by_hand(
        [6.0, 3.0], [0.0, 6.0], [True, False], [3.0, 1.0], ([0, 1], [0, 1], [0, 0], [0, 0], [0, 1])
    ),
]


def test_summary_by_hand():
    """Two missions over three windows: means of the costs, totals of the packets."""
    summary = summarise(THREE_WINDOWS)
    expected = {
        "aoi_mean": [3.0, 1.5],
        "velocity_variance_mean": [5.0, 5.0],
        "velocity_variance_first": [9.0, 4.0],
        "velocity_variance_last": [0.0, 6.0],
        "hops_mean": [1.5, 1.0],
        "packets_sent": [5.0, 4.0],
        "packets_transmitted": [12.0, 6.0],
        "packets_attempted": [5.0, 4.0],
        "packets_delivered": [3.0, 2.0],
        "packets_lost": [2.0, 2.0],
        "packets_overheard": [2.0, 4.0],
        "packets_answered": [1.0, 2.0],
        "packets_heard": [np.nan, np.nan],
        "hearers_per_packet": [np.nan, np.nan],
    }
    for name, numbers in expected.items():
        np.testing.assert_allclose(getattr(summary, name), numbers, err_msg=name)
    assert summary.num_windows == 3


def test_broadcasts_are_summed_up_by_hand():
    """7 of 10 packets are heard, by 15 robots; in the second mission none is sent."""
    counts = [([6.0, 0.0], [4.0, 0.0], [12.0, 0.0]), ([4.0, 0.0], [3.0, 0.0], [3.0, 0.0])]
    flown = [broadcast_by_hand(*each) for each in zip(THREE_WINDOWS[:2], counts, strict=True)]
    summary = summarise(flown)
    np.testing.assert_array_equal(summary.packets_sent, [10.0, 0.0])
    np.testing.assert_array_equal(summary.packets_heard, [7.0, 0.0])
    np.testing.assert_array_equal(summary.hearers_per_packet, [1.5, np.nan])
    for name in ADDRESSED:
        assert np.isnan(getattr(summary, f"packets_{name}")).all()


@pytest.mark.parametrize(
    ("first", "expected"), [(0, [2.0, np.nan]), (1, [1.0, np.nan]), (2, [1.0, np.nan])]
)
def test_complete_window_is_the_first_or_none(first, expected):
    """Counted from 1 at the first window given; the second mission never completes."""
    summary = summarise(THREE_WINDOWS[first:])
    np.testing.assert_array_equal(summary.complete_window, expected)


def test_summary_of_no_windows_is_a_clear_error():
    with pytest.raises(ValueError, match="at least 1 window"):
        summarise([])


def small_flight(num_windows=12):
    mission = paper("flocking", num_robots=8, num_windows=num_windows)
    return Swarm(mission, [3, 4]), make_policy("mst", mission, 0.3)


def test_flight_is_the_missions_windows_step_by_step():
    """The costs are those of the swarm stepped by hand, and the hops those of its buffers."""
    swarm, policy = small_flight()
    by_hand = Swarm(swarm.mission, [3, 4])
    rival = make_policy("mst", swarm.mission, 0.3)
    by_hand.start(rival)
    num_flown = 0
    for window in rollout(swarm, policy):
        costs = by_hand.step(rival)
        num_flown += 1
        np.testing.assert_array_equal(swarm.now, num_flown)
        np.testing.assert_array_equal(window.costs.age_windows, costs.age_windows)
        np.testing.assert_array_equal(window.hops, mean_hops(by_hand.buffers))
    assert num_flown == 12


def test_windows_of_a_flight_keep_their_costs():
    """The costs of a window do not change while the flight goes on."""
    swarm, policy = small_flight()
    ages, flown = zip(
        *((w.costs.age_windows.copy(), w) for w in rollout(swarm, policy)), strict=True
    )
    np.testing.assert_array_equal([window.costs.age_windows for window in flown], ages)
    np.testing.assert_allclose(summarise(flown).aoi_mean, np.mean(ages, axis=0))
