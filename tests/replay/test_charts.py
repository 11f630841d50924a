"""What the charts show, against plain loops."""

import numpy as np

from swarm_mj.policies.minimum_spanning_tree import spanning_tree
from swarm_mj.replay.charts import radio_states, rate, walk


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
    names, colours, state = radio_states(log)
    assert len(names) == len(colours)
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


def test_a_flooding_robot_delivers_if_either_packet_does(flooded):
    log = flooded.log
    names, _, state = radio_states(log)
    robots = np.arange(log.recipient.shape[2])
    for t, i in np.argwhere(np.any(log.recipient != robots, axis=1)):
        sent = [(p, log.recipient[t, p, i]) for p in (0, 1) if log.recipient[t, p, i] != i]
        got = any(log.heard[t, p, to] == i for p, to in sent)
        assert names[state[t, i]] == ("delivers" if got else "is lost")
