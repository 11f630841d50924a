"""The rollout buffer without most of the silent rows."""

import numpy as np
import pytest
import torch
from gymnasium import spaces

from swarm_mj.learning.active_rollout_buffer import SILENT_SHARE, ActiveRolloutBuffer

STEPS, ROWS, ROBOTS = 40, 50, 5


def filled(speaks):
    """A buffer of numbered rows, of which those marked spoke; a row's reward is its number."""
    space = spaces.Dict(
        {
            "owner": spaces.Box(0, ROBOTS - 1, (1,), np.int32),
            "number": spaces.Box(0, STEPS * ROWS, (1,), np.float32),
        }
    )
    buffer = ActiveRolloutBuffer(STEPS, space, spaces.Discrete(ROBOTS), device="cpu", n_envs=ROWS)
    owner = np.tile(np.arange(ROBOTS, dtype=np.int32), ROWS // ROBOTS)[:, None]
    for step in range(STEPS):
        number = np.arange(step * ROWS, (step + 1) * ROWS, dtype=np.float32)
        action = np.where(speaks[step][:, None], (owner + 1) % ROBOTS, owner)
        zeros = torch.zeros(ROWS)
        buffer.add(
            {"owner": owner, "number": number[:, None]},
            action,
            number,
            np.zeros(ROWS),
            zeros,
            zeros,
        )
    buffer.compute_returns_and_advantage(torch.zeros(ROWS), np.zeros(ROWS))
    return buffer


@pytest.fixture
def speaks():
    return np.random.default_rng(1).random((STEPS, ROWS)) < 0.15


def numbers_in(batches):
    return np.concatenate([batch.observations["number"][:, 0].numpy() for batch in batches])


def test_all_speakers_and_a_share_of_the_silent_are_kept(speaks):
    np.random.seed(1)  # noqa: NPY002 - stable-baselines3's generator
    kept = numbers_in(filled(speaks).get(200))
    assert len(kept) == len(set(kept))
    spoke = set(np.flatnonzero(speaks.ravel()).astype(float))
    assert spoke <= set(kept)
    num_silent = STEPS * ROWS - len(spoke)
    share = (len(kept) - len(spoke)) / num_silent
    error = np.sqrt(SILENT_SHARE * (1 - SILENT_SHARE) / num_silent)
    assert abs(share - SILENT_SHARE) < 4.0 * error


def test_every_pass_keeps_others_of_the_silent_in_another_order(speaks):
    np.random.seed(1)  # noqa: NPY002
    buffer = filled(speaks)
    first, second = (list(numbers_in(buffer.get(200))) for _ in range(2))
    assert set(first) != set(second)
    both = set(first) & set(second)
    assert [row for row in first if row in both] != [row for row in second if row in both]


def test_rows_stay_whole(speaks):
    """A reward is its row's number, and so are advantage and return; the action is the row's."""
    np.random.seed(1)  # noqa: NPY002
    for batch in filled(speaks).get(200):
        number = batch.observations["number"][:, 0].numpy().astype(int)
        np.testing.assert_array_equal(batch.advantages, number)
        np.testing.assert_array_equal(batch.returns, number)
        owner = batch.observations["owner"][:, 0].numpy()
        np.testing.assert_array_equal(owner, number % ROBOTS)
        spoke = batch.actions[:, 0].numpy() != owner
        np.testing.assert_array_equal(spoke, speaks.ravel()[number])


def test_minibatches_are_as_many_as_of_all_rows(speaks):
    np.random.seed(1)  # noqa: NPY002
    sizes = [len(batch.advantages) for batch in filled(speaks).get(STEPS * ROWS // 10)]
    assert len(sizes) == 10
    assert max(sizes) - min(sizes) <= 1


def test_a_rollout_of_few_words_has_no_empty_minibatches():
    np.random.seed(1)  # noqa: NPY002
    speaks = np.zeros((STEPS, ROWS), dtype=bool)
    buffer = filled(speaks)
    buffer.actions[0, 0, 0] = 1
    for batch in buffer.get(1):
        assert len(batch.advantages) > 0
