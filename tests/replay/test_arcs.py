"""Arcs over the ground."""

import numpy as np

from swarm_mj.replay.arcs import RISE, SEGMENTS, arcs


def test_an_arc_starts_and_ends_at_its_ends_and_is_highest_in_the_middle():
    start, end = np.array([[0.0, 0.0], [10.0, 5.0]]), np.array([[100.0, 0.0], [10.0, -35.0]])
    points = arcs(start, end, 2.0)
    assert points.shape == (2, SEGMENTS + 1, 3)
    np.testing.assert_allclose(points[:, 0], np.pad(start, ((0, 0), (0, 1)), constant_values=2.0))
    np.testing.assert_allclose(points[:, -1], np.pad(end, ((0, 0), (0, 1)), constant_values=2.0))
    np.testing.assert_allclose(points[:, SEGMENTS // 2, 2], 2.0 + RISE * np.array([100.0, 40.0]))
    np.testing.assert_allclose(points[0, :, 1], 0.0)


def test_no_packets_are_no_arcs():
    assert arcs(np.zeros((0, 2)), np.zeros((0, 2))).shape == (0, SEGMENTS + 1, 3)
