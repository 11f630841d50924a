"""PPO's clipped objective against one that is written down for each action."""

from math import exp

import numpy as np
import pytest
import torch
from residual_lessons import lesson_of, seen_at_random

from swarm_mj.learning.residual.network import ResidualNetwork
from swarm_mj.learning.residual.ppo import SCALE, PpoSettings, improve, surrogate
from swarm_mj.policies.residual.features import NEIGHBOUR_FEATURES, ROBOT_FEATURES, Seen

SETTINGS = PpoSettings(least_ratio=0.7, most_ratio=1.5)


def sigmoid(logit):
    return 1.0 / (1.0 + exp(-logit))


def expected(now, before, worth):
    """The mean over both actions; ratios are clipped where they would gain more."""
    value = sigmoid(before) * worth  # of silence 0
    mean = 0.0
    for sign, gained in ((1.0, worth), (-1.0, 0.0)):
        probability, advantage = sigmoid(sign * before), gained - value
        ratio = sigmoid(sign * now) / probability
        ratio = min(ratio, 1.5) if advantage > 0.0 else max(ratio, 0.7)
        mean += probability * ratio * advantage
    return mean


def gained(now, before, worth):
    """The same by the code, and its gradient by the logits."""
    logits = torch.tensor(now, dtype=torch.float64, requires_grad=True)
    others = (torch.tensor(each, dtype=torch.float64) for each in (before, worth))
    found = surrogate(logits, *others, SETTINGS)
    found.sum().backward()
    return found.detach().numpy(), logits.grad.numpy()


def test_it_is_the_mean_over_both_actions_of_what_is_clipped():
    """Transmitting becomes likelier or less likely, within the ratios and beyond."""
    cases = [
        (now, before, worth)
        for before in (-3.0, 0.0, 0.4, 2.0)
        for now in (before - 4.0, before - 0.2, before, before + 0.2, before + 4.0)
        for worth in (-2.0, 0.0, 1.5)
    ]
    found, _ = gained(*zip(*cases, strict=True))
    np.testing.assert_allclose(found, [expected(*case) for case in cases], atol=1e-9)


def test_at_first_its_gradient_is_that_of_the_worth_that_is_expected():
    before, worth = np.linspace(-6.0, 6.0, 9), np.linspace(3.0, -2.0, 9)
    p = np.array([sigmoid(logit) for logit in before])
    _, gradient = gained(before, before, worth)
    np.testing.assert_allclose(gradient, p * (1.0 - p) * worth, atol=1e-9)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_beyond_the_ratios_there_is_a_way_back_only(direction):
    """From even odds to 95 %, or 5 %: a factor of 1.9 for one action, 0.1 for the other."""
    _, gradient = gained([3.0 * direction] * 2, [0.0] * 2, [direction, -direction])
    assert gradient[0] == 0.0
    assert direction * gradient[1] < 0.0


def improved(lessons, settings=SETTINGS, width=4, rate=1e-2, times=1):
    """A network that took steps on lessons, by plain gradient descent."""
    torch.manual_seed(3)
    network = ResidualNetwork(width, 0.0)
    torch.nn.init.normal_(network.logit.weight)
    before = network.state_dict_copy()
    optimiser = torch.optim.SGD(network.parameters(), lr=rate)
    for _ in range(times):
        improve(network, optimiser, lessons, settings, torch.Generator().manual_seed(1))
    return network, before


def says(network, seen):
    return network(*(torch.from_numpy(each) for each in seen)).detach().numpy()


def test_who_gains_by_transmitting_transmits_more_and_who_loses_less():
    seen = seen_at_random(1, 60)
    gains = seen.robots[:, 4] > 0.0
    network = ResidualNetwork(8, 0.0)
    optimiser = torch.optim.Adam(network.parameters(), lr=1e-2)
    generator = torch.Generator().manual_seed(1)
    for _ in range(60):
        lesson = lesson_of(seen, np.where(gains, 1.0, -1.0), says(network, seen))
        improve(network, optimiser, [lesson], SETTINGS, generator)
    after = says(network, seen)
    assert np.all(after[gains] > 0.0)
    assert np.all(after[~gains] < 0.0)


def worths(seed, num_rows):
    return np.random.default_rng(seed).normal(0.0, 1.0, num_rows)


@pytest.mark.parametrize("parts", [1, 4])
def test_a_pass_sees_every_decision_once_with_its_own_neighbours(parts):
    """Steps too small to matter add up to the gradient over all lessons, part by part."""
    seen = [seen_at_random(1, 80), seen_at_random(2, 48)]
    worth = [worths(1, 80) / 3.0, worths(2, 48) * 5.0]
    lessons = list(map(lesson_of, seen, worth))
    settings = PpoSettings(epochs=1, minibatch=128 // parts, max_gradient_norm=1e9)
    network, before = improved(lessons, settings, rate=1e-4)

    again, _ = improved([], times=0)
    again.load_state_dict(before)
    terms = [
        surrogate(
            again(*map(torch.from_numpy, each)),
            torch.zeros(len(gained)),
            torch.tensor(gained / gained.std(), dtype=torch.float32),
            settings,
        )
        for each, gained in zip(seen, worth, strict=True)
    ]
    (parts * SCALE * torch.cat(terms).mean()).backward()
    for name, parameter in again.named_parameters():
        step = (network.state_dict()[name] - before[name]) / 1e-4
        np.testing.assert_allclose(step, parameter.grad, rtol=0.02, atol=2e-3)


def test_a_decision_counts_as_often_as_its_weight_says():
    """Half of the decisions gain by transmitting, half lose as much, and nobody can tell them."""
    robots, neighbours = (
        np.full((32, len(names)), 0.25, dtype=np.float32)
        for names in (ROBOT_FEATURES, NEIGHBOUR_FEATURES)
    )
    seen = Seen(robots, neighbours, np.arange(32))
    is_even = np.arange(32) % 2 == 0
    start = says(improved([], times=0)[0], seen)
    for weight, way in ((3.0, 1.0), (1 / 3, -1.0)):
        worth = np.where(is_even, 1.0, -1.0)
        lesson = lesson_of(seen, worth, weight=np.where(is_even, weight, 1.0))
        network, _ = improved([lesson])
        assert np.all(way * (says(network, seen) - start) > 0.0)


def same(one, other):
    return all(
        torch.equal(parameter, other.state_dict()[name])
        for name, parameter in one.state_dict().items()
    )


def test_the_unit_of_a_lesson_does_not_matter_and_outliers_are_clipped():
    seen, worth = seen_at_random(1, 40), worths(1, 40)
    plain, _ = improved([lesson_of(seen, worth)])
    assert same(plain, improved([lesson_of(seen, 1024.0 * worth)])[0])
    assert not same(plain, improved([lesson_of(seen, np.sign(worth))])[0])
    settings = PpoSettings(most_worth=0.1)  # now signs are all that is left
    worth = np.sign(worth) * (1.0 + np.abs(worth))
    clipped, _ = improved([lesson_of(seen, worth)], settings)
    assert same(clipped, improved([lesson_of(seen, np.sign(worth))], settings)[0])


def test_steps_are_no_longer_than_said():
    seen, rate = seen_at_random(1, 40), 0.5
    settings = PpoSettings(epochs=1, max_gradient_norm=0.01)
    network, before = improved([lesson_of(seen, worths(1, 40))], settings, rate=rate)
    moved = [network.state_dict()[name] - before[name] for name in before]
    length = torch.sqrt(sum(torch.sum(each**2) for each in moved))
    assert float(length) == pytest.approx(0.01 * rate, rel=1e-3)
