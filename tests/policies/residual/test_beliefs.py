"""What robots remember, slot by slot and by hand.

Four robots stand on a line, 0.6 m apart, and a lone packet decodes up to 1 m: each hears those next
to it, but neither of them where both transmit. Those farther away jam nobody.
"""

import numpy as np
import pytest
from residual_networks import silent_weights

from swarm_mj.mission import paper
from swarm_mj.policies.residual.beliefs import no_beliefs, note_slot
from swarm_mj.policies.residual.making import residual_policy
from swarm_mj.radio.power_law import power_law
from swarm_mj.swarm import Swarm

THRESHOLD = 2.0
LINE = np.array([[0.0, 0.0], [0.6, 0.0], [1.2, 0.0], [1.8, 0.0]])
NEAR = np.array([[0.0, 0.0], [0.4, 0.0], [0.0, 0.4], [9.0, 0.0]])  # three hear each other, one none
NOTHING = np.zeros((4, 4), dtype=np.int32)


def note(beliefs, tick, *, known=NOTHING, heard_of=None, place_m=LINE, due=(), sent=(), heard=()):
    """Notes a slot; `due` are (i, j): i believes that j transmits; `heard` (i, j): i decoded j."""
    is_due, transmitted, decoded = (
        np.zeros((4, 4), dtype=bool),
        np.zeros(4, dtype=bool),
        [*range(4)],
    )
    for i, j in due:
        is_due[i, j] = True
    for i, j in heard:
        decoded[i] = j
    transmitted[list(sent)] = True
    note_slot(
        beliefs,
        np.array([tick]),
        np.array([known], dtype=np.int32),
        np.ones((1, 4, 4), dtype=bool) if heard_of is None else heard_of[None],
        np.array([[place_m] * 4]),
        is_due[None],
        transmitted[None],
        np.array([decoded]),
        power_law(np.full(4, THRESHOLD)),
        THRESHOLD,
    )


def stranger(i, j):
    """Everyone has heard of everyone, but i not of j."""
    heard_of = np.ones((4, 4), dtype=bool)
    heard_of[i, j] = False
    return heard_of


def told(*rows):
    """T of robots by their identity; of the others, nothing."""
    known = NOTHING.copy()
    for i, row in rows:
        known[i] = row
    return known


def same(beliefs, *but):
    """Whether all is as at first, except for these fields."""
    first = no_beliefs(1, 4)
    return all(
        np.array_equal(now, then)
        for name, now, then in zip(first._fields, beliefs, first, strict=True)
        if name not in but
    )


def test_whoever_decodes_a_packet_knows_all_that_its_sender_knew():
    beliefs = no_beliefs(1, 4)
    note(beliefs, 7, known=told((1, [4, 7, 5, 0]), (0, [7, 1, 1, 0])), heard=[(0, 1)])
    assert beliefs.held[0, 0].tolist() == [[0] * 4, [4, 7, 5, 0], [0] * 4, [0] * 4]
    assert not np.any(beliefs.held[0, 1:])
    assert beliefs.decoded[0].tolist() == [[0, 7, 0, 0], [0] * 4, [0] * 4, [0] * 4]
    assert beliefs.heard[0].tolist() == [7, 0, 0, 0]
    note(beliefs, 9, known=told((1, [4, 9, 3, 0])), heard=[(0, 1)])
    assert beliefs.held[0, 0, 1].tolist() == [4, 9, 3, 0]  # as it was said, older or not
    assert same(beliefs, "held", "decoded", "heard")


def test_robots_remember_when_they_transmitted():
    beliefs = no_beliefs(1, 4)
    note(beliefs, 3, sent=[1, 3])
    note(beliefs, 4, sent=[3])
    assert beliefs.sent[0].tolist() == [0, 3, 0, 4]
    assert same(beliefs, "sent")


@pytest.mark.parametrize(
    ("slot", "share"),
    [
        ({"due": [(0, 1)], "heard": [(0, 1)]}, 0.8 + 0.15 * 0.2),
        ({"due": [(0, 1)]}, 0.8 - 0.15 * 0.8),
        ({"due": [(0, 1), (0, 3)]}, 0.68),  # which is far from both
        ({"due": [(0, 1)], "heard": [(0, 2)]}, 0.68),
        ({"heard": [(0, 1)]}, 0.8),
        ({"due": [(1, 1), (2, 1)]}, 0.8),  # others believed so
        ({"due": [(0, 1)], "sent": [0]}, 0.8),
        ({"due": [(0, 1)], "heard_of": stranger(0, 1)}, 0.8),
        ({"due": [(0, 2)]}, 0.8),  # is too far away
        ({"due": [(0, 1), (0, 2)], "place_m": NEAR}, 0.8),  # jam each other
    ],
)
def test_robots_count_the_packets_that_they_should_have_decoded(slot, share):
    beliefs = no_beliefs(1, 4)
    note(beliefs, 5, **slot)
    assert beliefs.hears[0, 0, 1] == pytest.approx(share)
    beliefs.hears[0, 0, 1] = 0.8
    assert np.all(beliefs.hears[0, 0] == np.float32(0.8))


def test_robots_count_their_own_packets_that_a_teammate_knew_of_when_they_next_heard_it():
    """Robot 1 transmits in slot 5, 9 and 13. Robot 2 knew of the first, not of the second; robot 0
    is first heard after the third, of which robot 2 says nothing any more."""
    beliefs = no_beliefs(1, 4)

    def hear(tick, sender, known_until):
        note(beliefs, tick, known=told((sender, [0, known_until, 0, 0])), heard=[(1, sender)])
        return beliefs.heard_by[0, 1].tolist()

    assert hear(3, 2, 0) == pytest.approx([0.8] * 4)  # there is none to know of
    note(beliefs, 5, sent=[1])
    assert hear(6, 2, 5) == pytest.approx([0.8, 0.8, 0.83, 0.8])
    assert hear(7, 2, 4) == pytest.approx([0.8, 0.8, 0.83, 0.8])  # counted already
    note(beliefs, 9, sent=[1])
    assert hear(10, 2, 8) == pytest.approx([0.8, 0.8, 0.85 * 0.83, 0.8])
    note(beliefs, 13, sent=[1])
    assert hear(14, 0, 13) == pytest.approx([0.83, 0.8, 0.85 * 0.83, 0.8])
    assert np.all(beliefs.heard_by[0, [0, 2, 3]] == np.float32(0.8))


def test_robots_count_packets_from_out_of_range():
    """Robot 2 is 1.2 m from robot 0; of whom it has not heard before, it cannot tell."""
    beliefs, shares = no_beliefs(1, 4), []
    for sender, heard_of in [(2, None), (3, None), (1, None), (2, stranger(0, 2))]:
        note(beliefs, 5, heard=[(0, sender)], heard_of=heard_of)
        shares.append(beliefs.from_afar[0, 0])
    assert shares == pytest.approx([0.15, 0.2775, 0.2775 * 0.85, 0.2775 * 0.85**2])
    assert not np.any(beliefs.from_afar[0, 1:])


def after(held, **slot):
    """What robot 0 or 1 of a team believes that all know, if it was `held` and a slot passed."""
    beliefs = no_beliefs(1, 4)
    beliefs.held[0, :] = held
    note(beliefs, 9, **slot)
    return beliefs.held[0]


OLD = [[1, 2, 1, 2], [2, 1, 2, 1], [3, 1, 1, 1], [0, 0, 0, 4]]


def test_neighbours_know_what_a_robot_said_itself():
    """Robot 1 transmits, which the neighbours on both sides hear, but not robot 3 beyond them."""
    held = after(OLD, known=told((1, [5, 9, 0, 0])), sent=[1])
    assert held[1].tolist() == [[5, 9, 1, 2], [2, 1, 2, 1], [5, 9, 1, 1], [0, 0, 0, 4]]
    held = after(OLD, known=told((1, [5, 9, 0, 0])), sent=[1], due=[(1, 0)])
    assert held[1].tolist() == [OLD[0], OLD[1], [5, 9, 1, 1], OLD[3]]  # robot 0 transmits itself
    held = after(OLD, known=told((1, [5, 9, 0, 0])), sent=[1], heard_of=stranger(1, 2))
    assert held[1].tolist() == [[5, 9, 1, 2], *OLD[1:]]


def test_neighbours_know_what_others_said_that_were_due():
    """Robot 0 believes that robot 1 transmits, which robot 2 hears too: newer times replace."""
    slot = {"due": [(0, 1)], "place_m": NEAR}
    assert after(OLD, **slot)[0].tolist() == [OLD[0], OLD[1], [3, 1, 2, 1], OLD[3]]
    known = told((1, [7, 9, 0, 2]))
    held = after(OLD, **slot, known=known, heard=[(0, 1)])
    assert held[0].tolist() == [OLD[0], [7, 9, 0, 2], [7, 9, 1, 2], OLD[3]]
    slot = slot | {"heard_of": stranger(0, 1)}  # whose packet shows that it transmits
    assert after(OLD, **slot)[0].tolist() == OLD
    held = after(OLD, **slot, known=known, heard=[(0, 1)])
    assert held[0].tolist() == [OLD[0], [7, 9, 0, 2], [7, 9, 1, 2], OLD[3]]


def test_nobody_learns_from_packets_that_jam_each_other():
    """On the line robots 0 and 2 transmit: robot 1 hears neither. Robot 3 hears robot 2, but is
    no neighbour of robot 0, and one of robot 2."""
    known = told((0, [9, 8, 8, 8]), (2, [7, 7, 9, 7]))
    held = after(OLD, known=known, sent=[0, 2], due=[(0, 2), (2, 0)])
    assert held[0].tolist() == OLD
    assert held[2].tolist() == [*OLD[:3], [7, 7, 9, 7]]


def test_in_free_space_nobody_takes_a_teammate_for_better_informed_than_it_is():
    """Once all have long followed the plan, what is reckoned comes true."""
    mission, num_ahead = paper("stationary", num_robots=7, range_ratio=0.3), 0
    policy = residual_policy(silent_weights(), mission, is_deterministic=True)
    swarm = Swarm(mission, [1, 2])
    swarm.start(policy)
    for window in range(60):
        swarm.step(policy)
        if window >= 40:
            views = swarm.views
            before = policy._beliefs.held.copy()
            policy.transmits(views)
            held, ticks = policy._beliefs.held, np.rint(2 * views.buffers.timestamp)
            assert np.all(held <= ticks[:, None])
            num_ahead += np.sum(held != before)
    assert num_ahead > 100
