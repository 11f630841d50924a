"""What robots see, by hand.

Four robots stand on a line, 0.6 m apart. A lone packet decodes up to 1 m, where its SINR is 2: its
power is 2 / d². So each robot is a neighbour of those next to it. It is about to be slot 100, and
robot 1 decides.
"""

from math import log1p, log10

import numpy as np
import pytest

from swarm_mj.policies.residual.beliefs import no_beliefs
from swarm_mj.policies.residual.features import (
    NEIGHBOUR_FEATURES,
    ROBOT_FEATURES,
    room_to_see,
    see,
)
from swarm_mj.policies.residual.proposals import Proposal
from swarm_mj.radio.power_law import power_law

THRESHOLD, NOW = 2.0, 100
LINE = [[0.0, 0.0], [0.6, 0.0], [1.2, 0.0], [1.8, 0.0]]
ONE, TWO = 2 / 0.6**2, 2 / 1.2**2  # power over one gap, and over two [noise]
KNOWN = [97, 99, 97, 80]  # T of robot 1
HELD = [[95, 92, 60, 50], [0, 0, 0, 0], [70, 90, 98, 96], [40, 85, 91, 94]]  # and of its teammates


def eyes(*, due=(), place_m=LINE, num_robots=4, rows=((0, 1),), unheard=(), **overrides):
    """What robot 1 sees if these are due: of itself, and by neighbour, by feature."""
    beliefs = no_beliefs(1, num_robots)
    is_due = np.zeros((1, num_robots, num_robots), dtype=bool)
    is_due[:, :, list(due)] = True
    is_known = np.ones_like(is_due)
    is_known[0, 1, list(unheard)] = False
    its = {
        "tick": NOW,
        "known": KNOWN,
        "held": HELD,
        "due_in": [10] * num_robots,
        "is_agreed": True,
        "draw": [0.1, 0.5, 0.7, 0.9],
        "decoded": [0] * num_robots,
        "hears": [0.8] * num_robots,
        "heard_by": [0.8] * num_robots,
        "sent": 0,
        "heard": 0,
        "from_afar": 0.0,
    } | overrides
    for name in ("held", "decoded", "hears", "heard_by", "sent", "heard", "from_afar"):
        getattr(beliefs, name)[0, 1] = its[name]
    observed = np.zeros((1, num_robots, num_robots), dtype=np.int32)
    observed[0, 1] = its["known"]
    room = room_to_see(len(rows), num_robots)
    room.robots[...] = room.neighbours[...] = np.nan
    count = see(
        np.array(rows),
        np.array([its["tick"]]),
        beliefs,
        observed,
        is_known,
        np.array([[place_m] * num_robots]),
        Proposal(
            is_due,
            np.array([[its["due_in"]] * num_robots], dtype=np.int16),
            np.full((1, num_robots), its["is_agreed"]),
        ),
        np.array([its["draw"]]),
        power_law(np.full(num_robots, THRESHOLD)),
        THRESHOLD,
        room,
    )
    assert not np.any(np.isnan(room.robots))
    assert not np.any(np.isnan(room.neighbours[:count]))
    assert np.all(np.isnan(room.neighbours[count:]))
    robots = [dict(zip(ROBOT_FEATURES, row, strict=True)) for row in room.robots.tolist()]
    edges = [dict(zip(NEIGHBOUR_FEATURES, row, strict=True)) for row in room.neighbours[:count]]
    if len(rows) > 1:
        return robots, edges, room.owner[:count].tolist()
    assert not np.any(room.owner[:count])
    return robots[0], edges


def approx(value):
    return pytest.approx(value, rel=1e-5, abs=1e-6)


def younger(told, held, but):
    """By how much news is younger, over robots but one: of times of the last observation."""
    return sum(max(told[k] - held[k], 0) for k in range(4) if k != but) / 4


def test_margins_are_decades_of_sinr_above_the_threshold():
    """Robot 3 is due. Robot 2 hears it over one gap, robot 0 over three."""
    own, (before, behind) = eyes(due=[3])
    three = 2 / 1.8**2
    assert before["margin"] == behind["margin"] == approx(log10(ONE / 2))
    assert before["margin_now"] == approx(log10(ONE / (1 + three) / 2))
    assert behind["margin_now"] == approx(log10(ONE / (1 + ONE) / 2))
    assert before["margin_of_other"] == approx(log10(three / 2))
    assert behind["margin_of_other"] == approx(log10(ONE / 2))
    assert own["margin"] == approx(log10(TWO / 2))
    own, (before, _) = eyes(due=[2, 3])
    assert own["margin"] == approx(log10(ONE / (1 + TWO) / 2))
    assert before["margin_of_other"] == approx(log10(TWO / (1 + three) / 2))


def test_margins_have_limits():
    """Of silence, and of a robot that stands 1 mm away."""
    own, (near, _) = eyes(place_m=[[0.599, 0.0], *LINE[1:]])
    assert near["margin"] == 2.0
    assert near["margin_of_other"] == own["margin"] == -2.0


def test_a_neighbour_is_jammed_that_would_decode_another_if_this_robot_kept_silent():
    """Robot 2 loses what robot 3 says; if nobody else is due, there is nothing to lose."""
    _, (before, behind) = eyes(due=[3])
    assert (before["is_jammed"], behind["is_jammed"]) == (0.0, 1.0)
    assert eyes()[1][1]["is_jammed"] == 0.0
    near = [*LINE[:3], [1.25, 0.0]]  # so near to robot 2 that it is heard beside robot 1
    assert eyes(due=[3], place_m=near)[1][1]["is_jammed"] == 0.0


def test_news_is_what_a_packet_would_make_younger():
    """What robot 1 knows of itself is as new as the slot; of the listener it tells nothing new."""
    _, (before, behind) = eyes()
    said = [97, 100, 97, 80]
    assert younger(said, HELD[0], 0) == (8 + 37 + 30) / 4
    assert before["news"] == approx(0.5 * log1p((8 + 37 + 30) / 4))
    assert behind["news"] == approx(0.5 * log1p((27 + 10) / 4))
    assert before["balance"] == approx(0.05 * (8 + 37 + 30) / 4)
    assert before["news_of_other"] == behind["news_of_other"] == 0.0


def test_news_is_held_against_what_is_lost():
    """Robot 3 is due, so that robot 2 would decode neither it nor robot 1, if both transmit."""
    _, (before, behind) = eyes(due=[3])
    lost = younger([*HELD[3][:3], 100], HELD[2], 2)
    assert lost == 4 / 4
    assert behind["news"] == approx(0.5 * log1p((27 + 10) / 4))
    assert behind["news_of_other"] == approx(0.5 * log1p(lost))
    assert behind["balance"] == approx(-0.05 * lost)
    assert before["balance"] == approx(0.05 * (8 + 37 + 30) / 4)


def test_a_neighbour_that_transmits_learns_nothing():
    own, (before, behind) = eyes(due=[2])
    assert (before["transmits"], behind["transmits"]) == (0.0, 1.0)
    assert behind["news"] == behind["news_of_other"] == behind["balance"] == 0.0
    assert before["news"] > 0.0
    assert own["gain"] == approx(0.5 * log1p(younger([*HELD[2][:2], 100, 96], KNOWN, 1)))
    assert younger([*HELD[2][:2], 100, 96], KNOWN, 1) == (3 + 16) / 4
    assert eyes(due=[3])[0]["gain"] == 0.0  # is too far away


def test_news_older_than_can_be_counted_is_as_old_as_any():
    """400 slots: at slot 1000, times 500 and 0 are alike, and 700 is younger by 100."""
    held = [[995, 1000, 500, 0], *HELD[1:]]
    _, (before, _) = eyes(tick=1000, known=[0, 999, 700, 590], held=held)
    assert before["news"] == approx(0.5 * log1p(100 / 4))


def test_ages_are_logarithms():
    own, (before, behind) = eyes(decoded=[60, 0, 99, 0], sent=93, heard=99)
    assert before["since_decoded"] == approx(0.3 * log1p(40))
    assert behind["since_decoded"] == approx(0.3 * log1p(1))
    assert before["age_of_us"] == approx(0.3 * log1p(8))
    assert behind["age_of_us"] == approx(0.3 * log1p(10))
    assert own["since_sent"] == approx(0.3 * log1p(7))
    assert own["since_heard"] == approx(0.3 * log1p(1))
    assert own["age"] == approx(0.3 * log1p((3 + 1 + 3 + 20) / 4))
    own, (before, _) = eyes(tick=1000, known=[700, 999, 0, 0], sent=599)
    assert before["since_decoded"] == own["since_sent"] == approx(0.3 * log1p(400))
    assert own["age"] == approx(0.3 * log1p((300 + 1 + 400 + 400) / 4))


def test_what_the_rule_says_is_seen():
    own, (before, behind) = eyes(due_in=[3, 5, 40, 2])
    assert (before["next_due"], behind["next_due"]) == (approx(3 / 40), 1.0)
    assert (own["proposed"], own["next_proposal"], own["is_agreed"]) == (-1.0, approx(5 / 40), 1.0)
    own, (_, behind) = eyes(due=[1], due_in=[3, 41, 60, 2], is_agreed=False)
    assert behind["next_due"] == 1.0
    assert (own["proposed"], own["next_proposal"], own["is_agreed"]) == (1.0, 1.0, 0.0)


def test_ones_own_packet_is_no_interference():
    for name in ("margin_now", "margin_of_other", "is_jammed"):
        alone, due = (eyes(due=each)[1][0][name] for each in ([], [1]))
        assert alone == due
    assert eyes(due=[1])[0]["margin"] == -2.0


def test_shares_of_packets_are_seen_and_their_means():
    own, (before, behind) = eyes(
        hears=[0.25, 0.8, 0.5, 0.9], heard_by=[1.0, 0.8, 0.125, 0.9], from_afar=0.375
    )
    assert (before["hears"], behind["hears"], own["hears"]) == (0.25, 0.5, 0.375)
    assert (before["heard_by"], behind["heard_by"], own["heard_by"]) == (1.0, 0.125, 0.5625)
    assert own["from_afar"] == 0.375


def test_draws_are_ranked():
    """Of two neighbours; one that draws the same draws no higher."""
    for draw, said, rank in [
        ([0.1, 0.5, 0.7, 0.9], (-1.0, 1.0), 0.5),
        ([0.6, 0.5, 0.7, 0.1], (1.0, 1.0), 1.0),
        ([0.5, 0.5, 0.2, 0.9], (-1.0, -1.0), 0.0),
    ]:
        own, (before, behind) = eyes(draw=draw)
        assert (before["draws_more"], behind["draws_more"]) == said
        assert own["rank"] == rank


def test_the_team_and_the_clock_are_seen():
    own, _ = eyes()
    assert own["degree"] == approx(0.2)
    assert own["team"] == approx(4 / 40)
    assert own["clock"] == approx(0.15 * log1p(100))


def test_robots_without_neighbours_have_no_means():
    own, neighbours = eyes(unheard=[0, 2], due=[2])
    assert neighbours == []
    assert own["degree"] == own["rank"] == own["hears"] == own["heard_by"] == own["gain"] == 0.0
    assert own["margin"] == -2.0  # of robot 2 it has not heard


def test_rows_are_robots_in_the_order_asked_for():
    """The ends of the line have one neighbour each, those within two."""
    robots, edges, owner = eyes(rows=[(0, 3), (0, 1), (0, 0)])
    assert owner == [0, 1, 1, 2]
    assert [robot["degree"] for robot in robots] == approx([0.1, 0.2, 0.1])
    alone = eyes()
    assert robots[1] == alone[0]
    assert edges[1:3] == alone[1]
