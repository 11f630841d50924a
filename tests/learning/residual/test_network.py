"""The network that learns is the network that flies."""

import numpy as np
import pytest
import torch
from residual_lessons import seen_at_random

from swarm_mj.learning.residual.network import ResidualNetwork


def tensors(seen):
    return [torch.from_numpy(each) for each in seen]


def test_it_says_what_its_weights_say_in_flight():
    network, seen = ResidualNetwork(6, 2.0), seen_at_random(1, 9)
    torch.nn.init.normal_(network.logit.weight, generator=torch.Generator().manual_seed(1))
    said = network(*tensors(seen)).detach().numpy()
    assert np.std(said) > 0.1
    for corrects_turns in (False, True):
        weights = network.weights(corrects_turns=corrects_turns)
        np.testing.assert_allclose(weights.logits(seen), said, rtol=1e-4, atol=1e-5)
        assert (weights.trust, weights.width) == (2.0, 6)
        assert weights.corrects_turns == corrects_turns


@pytest.mark.parametrize("trust", [0.0, 3.0])
def test_at_first_the_rule_decides_alone(trust):
    seen = seen_at_random(2, 9)
    said = ResidualNetwork(6, trust)(*tensors(seen)).detach().numpy()
    np.testing.assert_array_equal(said, trust * seen.robots[:, 0])


def test_copies_stay_as_they_are_while_it_learns():
    network = ResidualNetwork(4, 1.0)
    copies = [network.weights(corrects_turns=False).arrays, network.state_dict_copy()]
    with torch.no_grad():
        for parameter in network.parameters():
            parameter += 1.0
    for name, now in network.state_dict().items():
        for copy in copies:
            np.testing.assert_allclose(now, np.asarray(copy[name]) + 1.0, rtol=1e-5)
