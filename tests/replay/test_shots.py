"""Packets in space: their ends, colours and order."""

import numpy as np

from swarm_mj.replay import palette
from swarm_mj.replay.links import fates
from swarm_mj.replay.shots import LOST_SHARE, shots


def test_there_are_as_many_of_a_colour_as_packets_of_a_fate(two_way):
    log = two_way.log
    seen = shots(fates(log), log.position_m)
    for fate in ("delivered", "lost", "answered"):
        is_fate = np.all(seen.colour == getattr(palette, fate.upper()), axis=1)
        per_window = np.bincount(seen.row[is_fate], minlength=len(log.window))
        np.testing.assert_array_equal(per_window, two_way.counted(fate))
    assert np.all(np.diff(seen.row) >= 0)


def test_a_lost_packet_stops_short_and_a_delivered_one_arrives(two_way):
    log, packets = two_way.log, fates(two_way.log)
    for fate, share in (("lost", LOST_SHARE), ("delivered", 1.0)):
        links = packets[fate]
        seen = shots({fate: links}, log.position_m)
        start = log.position_m[links.row, links.sender]
        end = log.position_m[links.row, links.receiver]
        np.testing.assert_allclose(seen.start_m, start)
        np.testing.assert_allclose(seen.end_m, share * end + (1.0 - share) * start)


def test_broadcasts_have_one_look(flooded):
    seen = shots(fates(flooded.log), flooded.log.position_m)
    assert np.all(seen.colour == palette.BROADCAST)
    robots = np.arange(12)
    assert len(seen.row) == np.sum(flooded.log.heard != robots)
