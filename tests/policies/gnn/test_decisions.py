"""From a network's numbers to a choice of recipient: logits by hand (III-C)."""

import math

import numpy as np
import pytest
import torch

from swarm_mj.policies.gnn.decisions import recipient_logits
from swarm_mj.policies.learned import IMPOSSIBLE

ALL = torch.ones(2, 3, dtype=torch.bool)
OWNER = torch.tensor([0, 2])  # row 0 is robot 0's, row 1 robot 2's
# [row, node]: the logits of addressing a node at full power, and at none.
FULL = torch.tensor([[0.5, 1.0, -2.0], [3.0, 0.0, 1.0]])
ZERO = torch.tensor([[0.0, -1.0, 0.25], [1.0, 2.0, 4.0]])


def logits(output, may_address=ALL, silence_logit=0.0, has_turn=None):
    return recipient_logits(output, OWNER, may_address, silence_logit, has_turn).tolist()


@pytest.mark.parametrize(
    ("silence_logit", "has_turn", "own_0", "own_2"),
    [
        (0.0, None, 0.5, 1.0),  # one number per node is its logit, and one's own is silence
        (2.0, None, 2.5, 3.0),
        (2.0, [True, False], 0.5, 3.0),  # nothing is added to silence in one's turn
        (2.0, [False, False], 2.5, 3.0),
    ],
)
def test_eq9_the_silence_logit_is_added_to_ones_own_number(silence_logit, has_turn, own_0, own_2):
    has_turn = has_turn and torch.tensor(has_turn)
    found = logits(FULL[:, :, None], silence_logit=silence_logit, has_turn=has_turn)
    assert found == [[own_0, 1.0, -2.0], [3.0, 0.0, own_2]]


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


def test_masked_recipients_are_impossible_at_either_power():
    """As padding of a mixed team must be: zero power to it is no way to be silent."""
    assert logits(FULL[:, :, None], MASKED) == [[0.5, IMPOSSIBLE, -2.0], [IMPOSSIBLE, 0.0, 1.0]]
    own_0 = math.log(math.exp(0.0) + math.exp(0.25) + math.exp(0.5))
    own_2 = math.log(math.exp(2.0) + math.exp(4.0) + math.exp(1.0))
    found = logits(torch.stack([FULL, ZERO], dim=2), MASKED)
    expected = [[own_0, IMPOSSIBLE, -2.0], [IMPOSSIBLE, 0.0, own_2]]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


TURNS = [None, [True, False], [False, False]]


@pytest.mark.parametrize("has_turn", TURNS)
@pytest.mark.parametrize("most_speech", [0.05, 0.3, 0.6, 0.95])
def test_speech_is_at_most_as_probable_as_the_bound_but_in_ones_turn(most_speech, has_turn):
    """By the distribution without it: robots that speak too often are scaled down to the bound."""
    turns = has_turn and torch.tensor(has_turn)
    output = torch.stack([FULL, ZERO], dim=2)
    for numbers in (output, output[:, :, :1]):
        free = torch.softmax(recipient_logits(numbers, OWNER, MASKED, 0.5, turns), dim=1)
        bounded = recipient_logits(numbers, OWNER, MASKED, 0.5, turns, most_speech)
        found = torch.softmax(bounded, dim=1)
        for row, owner in enumerate(OWNER.tolist()):
            speech = 1.0 - free[row, owner].item()
            is_bound = speech > most_speech and not (has_turn and has_turn[row])
            share = most_speech / speech if is_bound else 1.0
            expected = [share * p for p in free[row].tolist()]
            expected[owner] = 1.0 - share * speech
            np.testing.assert_allclose(found[row], expected, rtol=1e-5, atol=1e-7)
        assert torch.all(found[~MASKED] == 0.0)


def test_a_bound_of_one_leaves_logits_as_they_are_to_the_bit():
    assert logits(FULL[:, :, None]) == FULL.tolist()
    free = recipient_logits(FULL[:, :, None], OWNER, ALL, 1.0, most_speech=1.0)
    assert torch.equal(free, recipient_logits(FULL[:, :, None], OWNER, ALL, 1.0))


@pytest.mark.parametrize("num_outputs", [1, 2])
def test_gradients_reach_every_number_that_counts(num_outputs):
    output = torch.stack([FULL, ZERO], dim=2)[:, :, :num_outputs].clone().requires_grad_()
    torch.softmax(recipient_logits(output, OWNER, ALL, 1.0), dim=1)[:, 1].sum().backward()
    assert output.grad is not None
    assert torch.all(output.grad != 0.0)
