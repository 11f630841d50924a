"""Lines of links that surprise, by hand."""

import numpy as np

from swarm_mj.replay import palette
from swarm_mj.replay.looks import Surprises
from swarm_mj.replay.strokes import DASHES, STROKES, WHOLE, shades, strokes, strokes_at_once

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


def test_dashes_lead_from_robot_to_robot_as_long_as_one_another():
    """Four dashes of 3 units with three gaps of 2 between them: a line of 18 units."""
    lines, link = strokes(links((0, 1)), 0.18 * WHERE[None], DASHES)
    ends = [[(0, 0), (3, 0)], [(5, 0), (8, 0)], [(10, 0), (13, 0)], [(15, 0), (18, 0)]]
    np.testing.assert_allclose(lines, ends, atol=1e-12)
    assert link.tolist() == [0, 0, 0, 0]


def test_a_link_is_where_its_robots_are_at_its_look():
    moved = np.stack([WHERE, WHERE + 7.0])
    lines, link = strokes(links((1, 2), (1, 2), row=[0, 1]), moved, WHOLE)
    np.testing.assert_allclose(lines, [[(100, 0), (0, 50)], [(107, 7), (7, 57)]])
    assert link.tolist() == [0, 1]


def test_all_kinds_at_once_each_in_its_colour():
    lines, colour = strokes_at_once(links((0, 1), (0, 2), row=[4, 4]), WHERE, observer=1)
    weak = [int(0.85 * c) for c in palette.TOO_WEAK]
    assert colour.tolist() == [list(STROKES["unbelieved"]), weak, weak, weak, weak]
    np.testing.assert_allclose(lines[0], [(0, 0), (0, 50)])


def test_at_once_only_the_observer_s_links_are_too_weak():
    """Robot 2 has none of that kind."""
    for observer, num_lines in ((0, 5), (1, 5), (2, 1)):
        lines, _ = strokes_at_once(links((0, 1), (0, 2)), WHERE, observer)
        assert len(lines) == num_lines


def test_the_more_is_missing_the_darker():
    found = links((0, 1), (0, 1), (0, 1), (0, 1))
    found.margin_db[:] = (-1, -15, -30, -99)
    brightness = shades("too_weak", found).astype(int).sum(axis=1)
    assert np.all(np.diff(brightness[:3]) < 0)
    assert brightness[2] == brightness[3]
