"""Batches of missions: staggered ends, fresh seeds, histories replayed."""

import numpy as np
import pytest

from swarm_mj.envs.mission_batch import FIRST_TRAINING_SEED, MissionBatch, make_batches
from swarm_mj.learning.settings import HELD_OUT_SEED
from swarm_mj.mission import paper
from swarm_mj.simulation.swarm import Swarm

MISSION = paper("random-walk", num_robots=5, num_windows=20, range_ratio=0.6)


def batches_of(sizes=(5,), num_missions=8, num_batches=4, seed=1):
    rng = np.random.default_rng(seed)
    return make_batches(MISSION, sizes, "extended", num_missions, num_batches, rng)


def random_recipients(rng, batch):
    shape = (batch.num_missions, batch.mission.num_robots)
    silence = np.broadcast_to(np.arange(shape[1]), shape)
    return np.where(rng.random(shape) < 0.3, rng.integers(0, shape[1], shape), silence)


def test_batches_end_at_different_times_and_then_whole_missions_later():
    batches, rng = batches_of(), np.random.default_rng(2)
    ends = {n: [] for n in range(4)}
    cuts = {n: [] for n in range(4)}
    for window in range(1, 46):
        for n, batch in enumerate(batches):
            transition = batch.step(random_recipients(rng, batch), with_credit=False)
            assert (transition.last_graphs is None) == (not np.all(batch._swarm.now == 0.0))
            if transition.last_graphs is not None:
                ends[n].append(window)
                cuts[n].append(transition.is_cut)
    assert ends == {0: [5, 25, 45], 1: [10, 30], 2: [15, 35], 3: [20, 40]}
    assert cuts == {
        0: [True, False, False], 1: [True, False], 2: [True, False], 3: [False, False],
    }  # fmt: skip


def test_every_mission_has_a_seed_of_its_own_that_is_not_held_out():
    batches, rng, seen = batches_of(), np.random.default_rng(2), []
    for _ in range(45):
        for batch in batches:
            seeds = batch.history.seeds
            if seeds not in seen:
                seen.append(seeds)
            batch.step(random_recipients(rng, batch), with_credit=False)
    drawn = [seed for seeds in seen for seed in seeds]
    assert len(drawn) == len(set(drawn)) >= 2 * (4 + 5)
    assert min(drawn) >= FIRST_TRAINING_SEED == 2**40 > HELD_OUT_SEED


def test_what_is_seen_after_an_end_is_the_new_missions_start():
    batch = batches_of(num_missions=4, num_batches=1)[0]
    rng = np.random.default_rng(2)
    for _ in range(20):
        transition = batch.step(random_recipients(rng, batch), with_credit=False)
    assert transition.last_graphs is not None
    new = Swarm(MISSION, batch.history.seeds)
    extractor = batch._extractor
    extractor.start(4, 5)
    expected = extractor.graphs(new.views)
    np.testing.assert_array_equal(transition.graphs.node, expected.node)
    np.testing.assert_array_equal(transition.graphs.parent, expected.parent)
    assert np.any(transition.last_graphs.node != transition.graphs.node)


def test_a_history_replayed_leads_to_the_same_state():
    """Also that of the features' memory, of the motion's dice, and of what follows."""
    first, rng = batches_of()[1], np.random.default_rng(2)
    for _ in range(17):  # beyond the first end
        transition = first.step(random_recipients(rng, first), with_credit=False)
    second = batches_of(seed=9)[1]
    graphs = second.replay(first.history)
    np.testing.assert_array_equal(graphs.node, transition.graphs.node)
    for _ in range(9):
        recipient = random_recipients(rng, first)
        one, other = (batch.step(recipient, with_credit=True) for batch in (first, second))
        np.testing.assert_array_equal(one.graphs.node, other.graphs.node)
        np.testing.assert_array_equal(one.credit, other.credit)
        np.testing.assert_array_equal(one.costs.age_windows, other.costs.age_windows)


def test_a_history_of_no_windows_is_the_start():
    batch = batches_of()[2]
    graphs = batch.replay(batch.history)
    np.testing.assert_array_equal(graphs.node, batch.restart().node)
    assert len(batch.history.recipients) == 0


def test_sizes_take_turns():
    assert [g.mission.num_robots for g in batches_of((3, 5))] == [3, 5, 3, 5]


@pytest.mark.parametrize(("missions", "batches"), [(7, 4), (2, 4), (4, 1)])
def test_missions_that_cannot_be_shared_out_are_refused(missions, batches):
    with pytest.raises(ValueError, match=f"not {missions}"):
        batches_of((3, 5), missions, batches)


def test_a_mission_of_one_window_starts_anew_every_window():
    rng = np.random.default_rng(1)
    mission = paper("stationary", num_robots=3, num_windows=1, range_ratio=1.0)
    batch = MissionBatch(mission, "paper", 2, rng, first_windows=1)
    before = batch.history.seeds
    transition = batch.step(np.array([[0, 1, 2], [1, 1, 2]]), with_credit=True)
    assert transition.last_graphs is not None
    assert not transition.is_cut
    assert not set(before) & set(batch.history.seeds)


def test_credit_is_what_silence_would_have_cost_the_team():
    """Beside teams that fly alike until the last window, in which one robot each is silent.

    How much T falls short there, summed over pairs; T of robots themselves is always now.
    """
    batch, rng = batches_of(num_missions=2, num_batches=1)[0], np.random.default_rng(3)
    recipients = [random_recipients(rng, batch) for _ in range(10)]
    for recipient in recipients:
        transition = batch.step(recipient, with_credit=True)

    def known(last):
        """The sum of T after the same windows but for the last one."""
        swarm = Swarm(MISSION, batch.history.seeds)
        for recipient in [*recipients[:-1], last]:
            swarm.exchange(recipient)
        return swarm.buffers.timestamp.sum(axis=(1, 2))

    for i in range(MISSION.num_robots):
        without = recipients[-1].copy()
        without[:, i] = i
        np.testing.assert_allclose(transition.credit[:, i], known(recipients[-1]) - known(without))
    assert np.any(transition.credit > 0.0)


def test_robots_that_were_switched_off_may_only_be_silent():
    mission = paper(
        "stationary", num_robots=5, range_ratio=1.0, num_windows=8, failure_fraction=0.4
    )
    batch = MissionBatch(mission, "paper", 2, np.random.default_rng(1), first_windows=8)
    for window in range(1, 8):
        graphs = batch.step(np.tile(np.arange(5), (2, 1)), with_credit=True).graphs
        choices = graphs.may_address.reshape(2, 5, 5).sum(axis=2)
        assert np.sum(choices == 1) == (4 if window > 4 else 0)
        is_off = np.argwhere(choices == 1)
        assert all(graphs.may_address.reshape(2, 5, 5)[b, i, i] for b, i in is_off)
