"""Packets as lines, against the costs' counts and a plain loop."""

import numpy as np
import pytest

from swarm_mj.replay.packets import RISE, SEGMENTS, arcs, packet_segments


@pytest.mark.parametrize(
    ("flight", "fate", "counted"),
    [
        *(("two_way", fate, fate) for fate in ("delivered", "lost", "overheard", "answered")),
        ("flooded", "heard", "receptions"),
    ],
)
def test_links_are_as_many_as_the_costs_count(flight, fate, counted, request):
    recorded = request.getfixturevalue(flight)
    links = recorded.log.packets[fate]
    assert np.all(np.diff(links.row) >= 0)
    found = np.bincount(links.row, minlength=len(recorded.log.window))
    np.testing.assert_array_equal(found, recorded.counted(counted))
    assert np.any(found)


def test_a_broadcast_leads_to_each_robot_that_decoded_it(flooded):
    log = flooded.log
    expected = [
        (t, log.heard[t, slot, hearer], hearer)
        for t, slot, hearer in np.ndindex(len(log.window), 2, 12)
        if log.heard[t, slot, hearer] != hearer
    ]
    assert list(zip(*log.packets["heard"], strict=True)) == expected


def test_answers_heard_or_not_are_the_delivered_requests_turned_round(two_way):
    links = two_way.log.packets
    requests = set(zip(*links["delivered"], strict=True))
    answers = {
        (row, receiver, sender)
        for fate in ("answered", "unanswered")
        for row, sender, receiver in zip(*links[fate], strict=True)
    }
    assert answers == requests


def test_segments_are_in_the_order_of_drawing_and_lost_ones_stop_short(two_way, flooded):
    log = two_way.log
    segments = packet_segments(log.packets, log.position_m)
    assert list(segments) == ["overheard", "unanswered", "lost", "delivered", "answered"]
    for fate, (row, start_m, end_m) in segments.items():
        share, links = 0.6 if fate in ("lost", "unanswered") else 1.0, log.packets[fate]
        start, end = (log.position_m[row, robot] for robot in (links.sender, links.receiver))
        np.testing.assert_array_equal(row, links.row)
        np.testing.assert_allclose(start_m, start)
        np.testing.assert_allclose(end_m, share * end + (1.0 - share) * start)
    assert list(packet_segments(flooded.log.packets, flooded.log.position_m)) == ["heard"]


def test_an_arc_starts_and_ends_at_its_ends_and_is_highest_in_the_middle():
    start, end = np.array([[0.0, 0.0], [10.0, 5.0]]), np.array([[100.0, 0.0], [10.0, -35.0]])
    points = arcs(start, end, 2.0)
    assert points.shape == (2, SEGMENTS + 1, 3)
    np.testing.assert_allclose(points[:, 0], np.pad(start, ((0, 0), (0, 1)), constant_values=2.0))
    np.testing.assert_allclose(points[:, -1], np.pad(end, ((0, 0), (0, 1)), constant_values=2.0))
    np.testing.assert_allclose(points[:, SEGMENTS // 2, 2], 2.0 + RISE * np.array([100.0, 40.0]))
    np.testing.assert_allclose(points[0, :, 1], 0.0)
    assert arcs(start[:0], end[:0], 0.0).shape == (0, SEGMENTS + 1, 3)
