"""Groups of missions: staggered ends, fresh seeds, courses flown again, padding."""

import numpy as np
import pytest

from swarm_mj.learning.missions import FIRST_TRAINING_SEED, Group, make_groups, padded
from swarm_mj.learning.settings import HELD_OUT_SEED
from swarm_mj.mission import paper
from swarm_mj.protocol.buffers import NO_PARENT
from swarm_mj.swarm import Swarm

MISSION = paper("random-walk", num_robots=5, num_windows=20, range_ratio=0.6)


def groups_of(sizes=(5,), num_missions=8, num_groups=4, seed=1):
    rng = np.random.default_rng(seed)
    return make_groups(MISSION, sizes, "extended", num_missions, num_groups, rng)


def random_recipients(rng, group):
    shape = (group.num_missions, group.mission.num_robots)
    silence = np.broadcast_to(np.arange(shape[1]), shape)
    return np.where(rng.random(shape) < 0.3, rng.integers(0, shape[1], shape), silence)


def test_groups_end_at_different_times_and_then_whole_missions_later():
    groups, rng = groups_of(), np.random.default_rng(2)
    ends = {n: [] for n in range(4)}
    cuts = {n: [] for n in range(4)}
    for window in range(1, 46):
        for n, group in enumerate(groups):
            outcome = group.step(random_recipients(rng, group), with_credit=False)
            assert (outcome.last_graphs is None) == (not np.all(group._swarm.now == 0.0))
            if outcome.last_graphs is not None:
                ends[n].append(window)
                cuts[n].append(outcome.is_cut)
    assert ends == {0: [5, 25, 45], 1: [10, 30], 2: [15, 35], 3: [20, 40]}
    assert cuts == {
        0: [True, False, False], 1: [True, False], 2: [True, False], 3: [False, False],
    }  # fmt: skip


def test_every_mission_has_a_seed_of_its_own_that_is_not_held_out():
    groups, rng, seen = groups_of(), np.random.default_rng(2), []
    for _ in range(45):
        for group in groups:
            seeds = group.course().seeds
            if seeds not in seen:
                seen.append(seeds)
            group.step(random_recipients(rng, group), with_credit=False)
    drawn = [seed for seeds in seen for seed in seeds]
    assert len(drawn) == len(set(drawn)) >= 2 * (4 + 5)
    assert min(drawn) >= FIRST_TRAINING_SEED == 2**40 > HELD_OUT_SEED


def test_what_is_seen_after_an_end_is_the_new_missions_start():
    group = groups_of(num_missions=4, num_groups=1)[0]
    rng = np.random.default_rng(2)
    for _ in range(20):
        outcome = group.step(random_recipients(rng, group), with_credit=False)
    assert outcome.last_graphs is not None
    new = Swarm(MISSION, group.course().seeds)
    extractor = group._extractor
    extractor.start(4, 5)
    expected = extractor.graphs(new.views)
    np.testing.assert_array_equal(outcome.graphs.node, expected.node)
    np.testing.assert_array_equal(outcome.graphs.parent, expected.parent)
    assert np.any(outcome.last_graphs.node != outcome.graphs.node)


def test_a_course_flown_again_leads_to_the_same_state():
    """Also that of the features' memory, of the motion's dice, and of what follows."""
    first, rng = groups_of()[1], np.random.default_rng(2)
    for _ in range(17):  # beyond the first end
        outcome = first.step(random_recipients(rng, first), with_credit=False)
    second = groups_of(seed=9)[1]
    graphs = second.fly_again(first.course())
    np.testing.assert_array_equal(graphs.node, outcome.graphs.node)
    for _ in range(9):
        recipient = random_recipients(rng, first)
        one, other = (group.step(recipient, with_credit=True) for group in (first, second))
        np.testing.assert_array_equal(one.graphs.node, other.graphs.node)
        np.testing.assert_array_equal(one.credit, other.credit)
        np.testing.assert_array_equal(one.age_windows, other.age_windows)


def test_a_course_of_no_windows_is_the_start():
    group = groups_of()[2]
    graphs = group.fly_again(group.course())
    np.testing.assert_array_equal(graphs.node, group.first_graphs.node)
    assert len(group.course().recipients) == 0


def test_padding_adds_nodes_that_nobody_hears_or_addresses():
    small, large = groups_of((3, 5), 4, 2)
    rows = padded([small.first_graphs, large.first_graphs], 5)
    assert rows["node"].shape[:2] == (2 * 3 + 2 * 5, 5)
    for name in ("node", "parent", "may_address"):
        np.testing.assert_array_equal(rows[name][:6, :3], getattr(small.first_graphs, name))
        np.testing.assert_array_equal(rows[name][6:], getattr(large.first_graphs, name))
    assert np.all(rows["node"][:6, 3:] == 0.0)
    assert np.all(rows["parent"][:6, 3:] == NO_PARENT)
    assert not np.any(rows["may_address"][:6, 3:])
    turns = np.concatenate([small.first_graphs.has_turn, large.first_graphs.has_turn])
    np.testing.assert_array_equal(rows["has_turn"][:, 0], turns)


def test_sizes_take_turns():
    assert [g.mission.num_robots for g in groups_of((3, 5))] == [3, 5, 3, 5]


@pytest.mark.parametrize(("missions", "groups"), [(7, 4), (2, 4), (4, 1)])
def test_missions_that_cannot_be_shared_out_are_refused(missions, groups):
    with pytest.raises(ValueError, match=f"not {missions}"):
        groups_of((3, 5), missions, groups)


def test_a_mission_of_one_window_starts_anew_every_window():
    rng = np.random.default_rng(1)
    mission = paper("stationary", num_robots=3, num_windows=1, range_ratio=1.0)
    group = Group(mission, "paper", 2, rng, first_windows=1)
    before = group.course().seeds
    outcome = group.step(np.array([[0, 1, 2], [1, 1, 2]]), with_credit=True)
    assert outcome.last_graphs is not None
    assert not outcome.is_cut
    assert not set(before) & set(group.course().seeds)
