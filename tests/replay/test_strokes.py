"""Lines of links that surprise, by hand."""

import numpy as np

from swarm_mj.replay import palette
from swarm_mj.replay.looks import Surprises
from swarm_mj.replay.strokes import BROKEN, STROKES, shades, strokes, strokes_at_once

WHERE = np.array([[0.0, 0.0], [100.0, 0.0], [0.0, 50.0]])


def links(*pairs, row=None):
    """Links between pairs of robots; those of robot 0 and 1 are too weak."""
    sender, receiver = np.array(pairs, dtype=np.int16).T
    return Surprises(
        row=np.zeros(len(pairs), dtype=int) if row is None else np.array(row),
        sender=sender,
        receiver=receiver,
        is_too_weak=np.array([set(pair) == {0, 1} for pair in pairs]),
        loss_db=np.zeros(len(pairs), dtype=np.int16),
        margin_db=np.zeros(len(pairs), dtype=np.int16),
    )


def test_a_link_that_is_too_weak_has_a_gap_in_its_middle():
    lines, link = strokes("too_weak", links((0, 1)), WHERE[None])
    ends = [[(0, 0), (100 * BROKEN, 0)], [(100 * (1 - BROKEN), 0), (100, 0)]]
    np.testing.assert_allclose(lines, ends)
    assert link.tolist() == [0, 0]


def test_a_link_is_where_its_robots_are_at_its_look():
    moved = np.stack([WHERE, WHERE + 7.0])
    lines, link = strokes("unbelieved", links((1, 2), (1, 2), row=[0, 1]), moved)
    np.testing.assert_allclose(lines, [[(100, 0), (0, 50)], [(107, 7), (7, 57)]])
    assert link.tolist() == [0, 1]


def test_all_kinds_at_once_each_in_its_colour():
    lines, colour = strokes_at_once(links((0, 1), (0, 2), row=[4, 4]), WHERE)
    assert colour[0].tolist() == list(STROKES["unbelieved"])
    assert colour[1].tolist() == colour[2].tolist() == [int(0.85 * c) for c in palette.TOO_WEAK]
    np.testing.assert_allclose(lines[0], [(0, 0), (0, 50)])


def test_the_more_is_missing_the_darker():
    found = links((0, 1), (0, 1), (0, 1), (0, 1))
    found.margin_db[:] = (-1, -15, -30, -99)
    brightness = shades("too_weak", found).astype(int).sum(axis=1)
    assert np.all(np.diff(brightness[:3]) < 0)
    assert brightness[2] == brightness[3]
