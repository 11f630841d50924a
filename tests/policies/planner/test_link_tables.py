"""Laws that drew what was observed are named, and links are near the truth."""

import math

import numpy as np
import pytest
from learning_reference import rounded

from swarm_mj.mission import paper
from swarm_mj.policies.planner.link_evidence import (
    NUM_BINS,
    Evidence,
)
from swarm_mj.policies.planner.link_tables import (
    LAWS,
    LinkTable,
    corrected,
    fit,
    link_fields,
    tables_of,
)
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.protocol.packets import packet_of
from swarm_mj.radio.links import links_between
from swarm_mj.radio.mission_radio import radio_of

NUM_ROBOTS, MISSION = 12, paper("stationary", num_robots=12)
SETTINGS = PlannerSettings()
PAIRS = np.triu_indices(NUM_ROBOTS, 1)


def symmetric(values):
    """The same in both directions, and nothing for oneself."""
    upper = np.triu(values, 1)
    return upper + upper.T


def drawn(excess_db, seed, *, fades=False, erasure=0.0, packets=12):
    """How often each pair decoded, and missed, packets of four margins 2 dB apart; drawn packet by
    packet from the rule of Eq. 4."""
    rng = np.random.default_rng([seed, 1])
    best_db = symmetric(rng.uniform(-6.0, 24.0, (NUM_ROBOTS, NUM_ROBOTS)))
    counts = np.zeros((2, NUM_ROBOTS, NUM_ROBOTS, NUM_BINS), dtype=np.int64)
    for j, i in np.argwhere(~np.eye(NUM_ROBOTS, dtype=bool)):
        for _ in range(packets):
            margin_db = best_db[j, i] - 2.0 * rng.integers(4)
            fade_db = 10.0 * math.log10(rng.exponential()) if fades else 0.0
            arrives = margin_db + excess_db[j, i] + fade_db >= 0.0 and rng.random() >= erasure
            place = math.floor((margin_db + 16.0) / 2.0)
            if place >= 0:
                counts[int(arrives), j, i, place] += 1
    return counts[1], counts[0]


def shadowed(seed, std_db=6.0):
    return symmetric(np.random.default_rng(seed).normal(0.0, std_db, (NUM_ROBOTS, NUM_ROBOTS)))


NOTHING_DB = np.zeros((NUM_ROBOTS, NUM_ROBOTS))


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    ("law", "fades", "erasure"),
    [
        ((math.inf, 0.0), False, 0.0),
        ((math.inf, 0.3), False, 0.3),
        ((0.0, 0.0), True, 0.0),
        ((0.0, 0.3), True, 0.3),
    ],
)
def test_the_law_of_fades_and_losses_is_named(law, fades, erasure, seed):
    """Where no link is other than believed; without fades the plan may go on."""
    table = fit(*drawn(NOTHING_DB, seed, fades=fades, erasure=erasure), SETTINGS)
    assert LAWS[table.law] == law
    assert not table.mean_db.any()
    assert not table.std_db.any()
    assert table.changes_nothing == (not fades)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("fades", "erasure"), [(False, 0.0), (True, 0.0)])
def test_shadowed_links_are_near_the_truth(seed, fades, erasure):
    """Nearer than what was believed before, and as far off as the table says that it may be."""
    excess_db = shadowed(seed)
    table = fit(*drawn(excess_db, seed, fades=fades, erasure=erasure), SETTINGS)
    assert LAWS[table.law] == (0.0 if fades else math.inf, erasure)
    assert not table.changes_nothing
    error_db = (table.mean_db - excess_db)[PAIRS]
    assert np.std(error_db) < 0.8 * np.std(excess_db[PAIRS])
    assert np.corrcoef(table.mean_db[PAIRS], excess_db[PAIRS])[0, 1] > 0.6
    assert 0.6 < np.sqrt(np.mean(error_db**2) / np.mean(table.std_db[PAIRS] ** 2)) < 1.6


@pytest.mark.parametrize("seed", range(2))
def test_blocked_links_are_named(seed):
    """Packets tell that should have arrived, with 2 dB to spare: those of bin 9 and above."""
    is_blocked = symmetric(np.random.default_rng(seed).random((NUM_ROBOTS, NUM_ROBOTS)) < 0.3) > 0
    decoded, missed = drawn(np.where(is_blocked, -40.0, 0.0), seed)
    table = fit(decoded, missed, SETTINGS)
    packets = decoded + missed
    told = np.sum((packets + packets.transpose(1, 0, 2))[..., 9:], axis=2)[PAIRS] > 5
    assert np.sum(told) > 40
    assert np.sum(is_blocked[PAIRS][told]) > 8
    np.testing.assert_array_equal(table.mean_db[PAIRS][told] < -15.0, is_blocked[PAIRS][told])


def test_both_directions_of_a_link_are_one():
    """Whoever listened: the table is symmetric, and the same for packets that went either way."""
    decoded, missed = drawn(shadowed(4), 4)
    table = fit(decoded, missed, SETTINGS)
    turned = fit(decoded.transpose(1, 0, 2), missed.transpose(1, 0, 2), SETTINGS)
    for one, other in ((table.mean_db, turned.mean_db), (table.std_db, turned.std_db)):
        np.testing.assert_array_equal(one, one.T)
        np.testing.assert_array_equal(one, other)
        assert not np.diag(one).any()


@pytest.mark.parametrize("seed", range(2))
def test_packets_carry_tables_exactly(seed):
    """What a table says is among the codes of its fields."""
    table = fit(*drawn(shadowed(seed, 12.0), seed), SETTINGS)
    *_, mean, std = link_fields(MISSION)
    assert table.mean_db.any()
    np.testing.assert_array_equal(rounded(mean, table.mean_db), table.mean_db)
    np.testing.assert_array_equal(rounded(std, table.std_db), table.std_db)
    np.testing.assert_array_equal(table.mean_db % 0.25, 0.0)


def test_a_step_from_what_was_believed_has_its_price():
    """Ten packets of 60 that are lost tell of losses, but not to one who asks for more."""
    nothing = np.zeros((2, 2, NUM_BINS), dtype=np.int64)
    decoded, missed = nothing.copy(), nothing.copy()
    decoded[0, 1, 20], missed[0, 1, 20] = 50, 10
    assert LAWS[fit(decoded, missed, SETTINGS).law] == (math.inf, 0.15)
    stubborn = PlannerSettings(min_log_odds=1000.0)
    assert LAWS[fit(decoded, missed, stubborn).law] == (math.inf, 0.0)


def table_of_two(mean_db, std_db, law=0):
    return LinkTable(
        law=law,
        mean_db=symmetric(np.full((2, 2), mean_db)),
        std_db=symmetric(np.full((2, 2), std_db)),
    )


def test_learned_links_by_hand():
    """10 dB weaker, give or take 4: packets are expected 12 dB weaker, to disturb 6 dB less, and
    to be off by 2 dB at most, which is row 4 of curves that step by 0.5 dB."""
    prior = links_between(radio_of(MISSION), np.array([[0.0, 0.0], [100.0, 0.0]]))
    settings = PlannerSettings(cautious_stds=0.5, disturbing_stds=1.0, max_std_db=2.0)
    table = table_of_two(-10.0, 4.0, LAWS.index((math.inf, 0.3)))
    links = corrected(prior, table, settings)
    ratio = links.received_mw[0, 1] / prior.received_mw[0, 1]
    assert ratio == pytest.approx(10.0**-1.2)
    assert links.interference_mw[0, 1] / prior.received_mw[0, 1] == pytest.approx(10.0**-0.6)
    assert links.row[0, 1] == 4
    assert links.curves.max() == pytest.approx(0.7)  # 30 % are lost, however strong they are
    assert links.is_doubtful


def test_only_links_that_differ_or_fade_call_for_another_plan():
    rayleigh, lossy = LAWS.index((0.0, 0.0)), LAWS.index((math.inf, 0.45))
    assert table_of_two(0.0, 0.0).changes_nothing
    assert table_of_two(0.0, 0.0, lossy).changes_nothing
    assert not table_of_two(0.0, 0.0, rayleigh).changes_nothing
    assert not table_of_two(0.0, 0.25).changes_nothing
    assert not table_of_two(0.25, 0.0).changes_nothing


def test_the_table_of_the_youngest_knowledge_is_better():
    """Robot 1 knows most; 0 and 2 as much as each other, of whom the first counts."""
    known_until = np.array([[8, 1, 2], [5, 8, 5], [2, 1, 8]])
    tables = tables_of(Evidence(3), known_until, SETTINGS)
    assert tables.rank.tolist() == [1, 0, 2]
    assert tables.table(2) is tables.table(2)


REST = paper("stationary")


def test_the_bytes_of_what_is_learned_of_links_by_hand():
    """Of 40 robots: the slot each plans since, and whether it hears of all; 64 kinds of packets
    each, of a sender, one of 24 bins, whether it was decoded and how often, up to 255 times; and
    two tables, with an owner, how much it knew, one of 8 laws, and two bytes for each of 780
    links."""
    notes = 40 * 64 * (8 + 5 + 1 + 8)
    table = 8 + 32 + 3 + 780 * (8 + 8)
    bits = 40 * (16 + 1) + notes + 2 * table
    assert sum(field.num_bits for field in link_fields(REST)) == bits == 82_046
    assert packet_of(REST, link_fields(REST)).num_bytes == 367 + 10_256  # 82,046 / 8, rounded up
