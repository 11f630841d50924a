"""Logits over recipients by hand, and draws against their probabilities."""

import math

import numpy as np
import pytest
import torch

from swarm_mj.gnn.action_distribution import IMPOSSIBLE, recipient_logits, sample

ALL = torch.ones(2, 3, dtype=torch.bool)
OWNER = torch.tensor([0, 2])  # row 0 is robot 0's, row 1 robot 2's
# [row, node]: the logits of addressing a node at full power, and at none.
FULL = torch.tensor([[0.5, 1.0, -2.0], [3.0, 0.0, 1.0]])
ZERO = torch.tensor([[0.0, -1.0, 0.25], [1.0, 2.0, 4.0]])


def logits(output, may_address=ALL, silence_logit=0.0, has_turn=None):
    return recipient_logits(output, OWNER, may_address, silence_logit, has_turn).tolist()


def test_eq9_one_number_per_node_is_its_logit_and_ones_own_is_silence():
    assert logits(FULL[:, :, None]) == FULL.tolist()


def test_the_silence_logit_is_added_to_ones_own():
    assert logits(FULL[:, :, None], silence_logit=2.0) == [[2.5, 1.0, -2.0], [3.0, 0.0, 3.0]]


@pytest.mark.parametrize(
    ("has_turn", "own_0", "own_2"), [([True, False], 0.5, 3.0), ([False, False], 2.5, 3.0)]
)
def test_nothing_is_added_to_silence_in_ones_turn(has_turn, own_0, own_2):
    found = logits(FULL[:, :, None], silence_logit=2.0, has_turn=torch.tensor(has_turn))
    assert found == [[own_0, 1.0, -2.0], [3.0, 0.0, own_2]]


@pytest.mark.parametrize("silence_logit", [0.0, -1.5])
def test_of_two_numbers_all_that_sends_nothing_is_silence(silence_logit):
    """Zero power to anyone, and full power to oneself."""
    own_0 = math.log(math.exp(0.0) + math.exp(-1.0) + math.exp(0.25) + math.exp(0.5))
    own_2 = math.log(math.exp(1.0) + math.exp(2.0) + math.exp(4.0) + math.exp(1.0))
    found = logits(torch.stack([FULL, ZERO], dim=2), silence_logit=silence_logit)
    expected = [[own_0 + silence_logit, 1.0, -2.0], [3.0, 0.0, own_2 + silence_logit]]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_two_numbers_make_the_probabilities_of_the_2_n_actions():
    """Against the softmax over all six actions of a row, those that are silence added up."""
    output = torch.stack([FULL, ZERO], dim=2)
    found = torch.softmax(torch.tensor(logits(output)), dim=1)
    for row, owner in enumerate(OWNER.tolist()):
        actions = torch.exp(output[row]) / torch.exp(output[row]).sum()
        full, zero = actions[:, 0].tolist(), actions[:, 1].tolist()
        expected = [p if k != owner else p + sum(zero) for k, p in enumerate(full)]
        np.testing.assert_allclose(found[row], expected, rtol=1e-6)


MASKED = torch.tensor([[True, False, True], [False, True, True]])


def test_masked_recipients_are_impossible_and_change_no_other():
    masked, free = np.array(logits(FULL[:, :, None], MASKED)), np.array(logits(FULL[:, :, None]))
    assert np.all(masked[~MASKED.numpy()] == IMPOSSIBLE)
    np.testing.assert_array_equal(masked[MASKED.numpy()], free[MASKED.numpy()])


def test_of_two_numbers_a_masked_recipient_counts_at_neither_power():
    """As padding of a mixed team must not: zero power to it is no way to be silent."""
    own_0 = math.log(math.exp(0.0) + math.exp(0.25) + math.exp(0.5))
    own_2 = math.log(math.exp(2.0) + math.exp(4.0) + math.exp(1.0))
    found = logits(torch.stack([FULL, ZERO], dim=2), MASKED)
    expected = [[own_0, IMPOSSIBLE, -2.0], [IMPOSSIBLE, 0.0, own_2]]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize("num_outputs", [1, 2])
def test_gradients_reach_every_number_that_counts(num_outputs):
    output = torch.stack([FULL, ZERO], dim=2)[:, :, :num_outputs].clone().requires_grad_()
    torch.softmax(recipient_logits(output, OWNER, ALL, 1.0), dim=1)[:, 1].sum().backward()
    assert output.grad is not None
    assert torch.all(output.grad != 0.0)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_a_grid_of_numbers_draws_each_recipient_as_often_as_it_is_probable(kind):
    """Of 10 000 numbers on a grid, each recipient gets its share but for one at either end."""
    rng = np.random.default_rng(4)
    for scale in (0.1, 1.0, 5.0):
        row = (scale * rng.standard_normal(7)).astype(kind)
        grid = (np.arange(10_000) + 0.5) / 10_000
        drawn = np.bincount(sample(np.tile(row, (10_000, 1)), grid), minlength=7)
        weight = [math.exp(float(logit)) for logit in row]
        expected = [10_000 * w / sum(weight) for w in weight]
        assert np.all(np.abs(drawn - expected) <= 1.01)


def test_the_cumulated_probabilities_decide():
    """Of shares 1/2, 1/4, 0, 1/4, in this order; the largest number below 1 takes the last."""
    shares = np.log([[2.0, 1.0, 1.0, 1.0]])
    shares[0, 2] = IMPOSSIBLE
    uniform = np.array([0.0, 0.499, 0.501, 0.749, 0.751, np.nextafter(1.0, 0.0)])
    drawn = sample(np.tile(shares, (6, 1)), uniform)
    assert drawn.tolist() == [0, 0, 1, 1, 3, 3]
    of_four_alike = sample(np.zeros((4, 4)), np.array([0.0, 0.25, 0.5, 0.75]))
    assert of_four_alike.tolist() == [0, 1, 2, 3]


def test_masked_recipients_are_never_drawn():
    """However likely the others of a row of 9, and whatever the number, 0 included."""
    rng = np.random.default_rng(2)
    logits = 30.0 * rng.standard_normal((5000, 9)).astype(np.float32)
    is_masked = rng.random((5000, 9)) < 0.6
    is_masked[np.arange(5000), rng.integers(0, 9, 5000)] = False
    logits[is_masked] = IMPOSSIBLE
    for uniform in (rng.random(5000), np.zeros(5000), np.full(5000, np.nextafter(1.0, 0.0))):
        assert not np.any(is_masked[np.arange(5000), sample(logits, uniform)])


def test_only_differences_of_logits_count():
    """A thousand more or less overflows nothing."""
    rng = np.random.default_rng(3)
    logits, uniform = rng.standard_normal((100, 5)), rng.random(100)
    for shift in (-1000.0, 1000.0):
        np.testing.assert_array_equal(sample(logits + shift, uniform), sample(logits, uniform))
