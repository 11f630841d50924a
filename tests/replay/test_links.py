"""Packets as lines, against the costs' counts and a plain loop."""

import numpy as np
import pytest

from swarm_mj.replay.links import ends, fates


@pytest.mark.parametrize("fate", ["delivered", "lost", "overheard", "answered"])
def test_links_are_as_many_as_the_costs_count(two_way, fate):
    np.testing.assert_array_equal(fates(two_way.log)[fate].per_window, two_way.counted(fate))


def test_links_of_broadcasts_are_as_many_as_the_costs_count(flooded):
    links = {fate: each.per_window for fate, each in fates(flooded.log).items()}
    np.testing.assert_array_equal(links["delivered"] + links["lost"], flooded.counted("sent"))
    receptions = links["delivered"] + links["overheard"]
    np.testing.assert_array_equal(receptions, flooded.counted("receptions"))


def test_every_fate_occurs_in_the_fixture(two_way):
    for fate, links in fates(two_way.log).items():
        assert len(links.row) > 0, fate


def test_answers_heard_or_not_are_the_delivered_requests_turned_round(two_way):
    links = fates(two_way.log)
    delivered = links["delivered"]
    requests = set(zip(delivered.row, delivered.sender, delivered.receiver, strict=True))
    answers = {
        (row, receiver, sender)
        for fate in ("answered", "unanswered")
        for row, sender, receiver in zip(
            links[fate].row, links[fate].sender, links[fate].receiver, strict=True
        )
    }
    assert answers == requests


def test_flooding_has_no_answers(flooded):
    links = fates(flooded.log)
    assert len(links["answered"].row) == len(links["unanswered"].row) == 0


def test_lines_run_from_sender_to_receiver(two_way):
    links = fates(two_way.log)["overheard"]
    start, end = ends(two_way.log, links)
    for n, (row, sender, receiver) in enumerate(
        zip(links.row, links.sender, links.receiver, strict=True)
    ):
        np.testing.assert_array_equal(start[n], two_way.log.position_m[row, sender])
        np.testing.assert_array_equal(end[n], two_way.log.position_m[row, receiver])
    assert np.all(np.diff(links.row) >= 0)
