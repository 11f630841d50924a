"""Packets as lines, against the costs' counts and a plain loop."""

import numpy as np
import pytest

from swarm_mj.replay.links import broadcast_counts, ends, fates, transmitters


@pytest.mark.parametrize("fate", ["delivered", "lost", "overheard", "answered"])
def test_links_are_as_many_as_the_costs_count(two_way, fate):
    np.testing.assert_array_equal(fates(two_way.log)[fate].per_window, two_way.counted(fate))


def test_lines_of_broadcasts_are_as_many_as_the_receptions_that_the_costs_count(flooded):
    assert list(fates(flooded.log)) == ["heard"]  # no addressee, so no other fate
    per_window = fates(flooded.log)["heard"].per_window
    np.testing.assert_array_equal(per_window, flooded.counted("receptions"))


def test_broadcasts_are_as_many_as_the_costs_count(flooded):
    sent, heard = broadcast_counts(flooded.log)
    np.testing.assert_array_equal(sent, flooded.counted("sent"))
    np.testing.assert_array_equal(heard, flooded.counted("heard"))


def test_a_broadcast_leads_to_each_robot_that_decoded_it(flooded):
    log, links = flooded.log, fates(flooded.log)["heard"]
    expected = [
        (t, log.heard[t, slot, hearer], hearer)
        for t in range(len(log.window))
        for slot in (0, 1)
        for hearer in range(12)
        if log.heard[t, slot, hearer] != hearer
    ]
    assert list(zip(links.row, links.sender, links.receiver, strict=True)) == expected


@pytest.mark.parametrize(("flight", "slots"), [("two_way", (0,)), ("flooded", (0, 1))])
def test_transmitters_are_who_speaks_without_being_asked(flight, slots, request):
    log = request.getfixturevalue(flight).log
    for t, i in np.ndindex(len(log.window), 12):
        assert transmitters(log)[t, i] == any(log.recipient[t, slot, i] != i for slot in slots)


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


def test_lines_run_from_sender_to_receiver(two_way):
    links = fates(two_way.log)["overheard"]
    start, end = ends(two_way.log, links)
    for n, (row, sender, receiver) in enumerate(
        zip(links.row, links.sender, links.receiver, strict=True)
    ):
        np.testing.assert_array_equal(start[n], two_way.log.position_m[row, sender])
        np.testing.assert_array_equal(end[n], two_way.log.position_m[row, receiver])
    assert np.all(np.diff(links.row) >= 0)
