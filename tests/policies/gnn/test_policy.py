"""A learned policy flies: reproducibly, locally, in teams of any size."""

import math

import numpy as np
import pytest
import torch
from mixed_missions import MISSION as WALK
from mixed_missions import NUM_ROBOTS, SEEDS, mixed_views
from tiny_policies import FEATURES, save_tiny, tiny_network

from swarm_mj.mission import paper, reference
from swarm_mj.policies.gnn.decisions import recipient_logits
from swarm_mj.policies.gnn.feature_sets import make_extractor
from swarm_mj.policies.gnn.policy import GnnPolicy
from swarm_mj.policies.learned import IMPOSSIBLE, sample
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm

MISSION = paper("random-walk", num_robots=7, num_windows=40)


def learned(features="extended", mission=MISSION, *, seed=1, outputs=1, sharpness=2.0, **options):
    """A policy whose robots are silent most of the time, so that packets arrive.

    The sharper it is, the more of what it does follows from what it sees, not from the dice.
    """
    network = tiny_network(features, seed, num_outputs=outputs)
    with torch.no_grad():
        for layer in network.modules():
            if isinstance(layer, torch.nn.Linear):
                layer.weight *= sharpness
    extractor = make_extractor(features, mission)
    return GnnPolicy(network, extractor, **{"silence_logit": 2.5} | options)


def decisions(policy, seeds, mission=MISSION):
    """Whom everyone addresses in every window of these missions [window, mission, robot]."""
    swarm, decided, num_heard = Swarm(mission, seeds), [], 0
    swarm.start(policy)
    for _ in range(mission.num_windows):
        decided.append(swarm.decide())
        num_heard += np.sum(swarm.step_with_recipients(decided[-1]).packets.delivered)
    assert num_heard > 0
    return np.array(decided)


def logits_of(policy, graphs, silence_logit):
    """The logits of two missions of seven robots, from the network itself."""
    output = policy._network(torch.tensor(graphs.node), torch.tensor(graphs.parent).long())
    rules = torch.tensor(graphs.may_address), silence_logit, torch.tensor(graphs.has_turn)
    return recipient_logits(output, torch.arange(7).repeat(2), *rules).detach().numpy()


@pytest.mark.parametrize(
    ("features", "outputs", "is_deterministic"),
    [*((features, 1, False) for features in FEATURES), ("reference", 2, False), ("paper", 1, True)],
)
def test_robots_draw_from_the_networks_logits_or_take_their_mode(
    features, outputs, is_deterministic
):
    """The first windows again, put together from the network, the draw and the mission's dice.

    Of two robots that look alike, as those never heard of do, the mode may be either.
    """
    its = {"silence_logit": 0.7, "is_deterministic": is_deterministic}
    policy, extractor = learned(features, outputs=outputs, **its), make_extractor(features, MISSION)
    extractor.start(2, 7)
    policy.start(7, [np.random.default_rng(b) for b in (5, 6)])
    dice = np.stack([np.random.default_rng(b).random((64, 7)) for b in (5, 6)])
    swarm, talk = Swarm(MISSION, [1, 2]), np.random.default_rng(1)
    for window in range(20 if is_deterministic else 5):
        logits = logits_of(policy, extractor.graphs(swarm.views), 0.7)
        recipient = policy.recipients(swarm.views)
        if is_deterministic:
            chosen = logits[np.arange(14), recipient.ravel()]
            np.testing.assert_allclose(chosen, logits.max(axis=1), atol=1e-5)
            recipient = np.where(talk.random((2, 7)) < 0.2, talk.integers(0, 7, (2, 7)), range(7))
        else:
            expected = sample(logits, dice[:, window].ravel()).reshape(2, 7)
            np.testing.assert_array_equal(recipient, expected)
        swarm.step_with_recipients(recipient)


@pytest.mark.parametrize("features", ["paper", "extended"])
def test_a_seed_is_a_flight_whatever_flies_beside_it(features):
    """One policy flies missions in turn, so it must forget the last ones too."""
    policy = learned(features)
    together = decisions(policy, [3, 4, 5])
    for b, seed in enumerate((3, 4, 5)):
        np.testing.assert_array_equal(decisions(policy, [seed])[:, 0], together[:, b])
    assert np.any(together[:, 0] != together[:, 1])
    assert np.any(together[:, :1] != decisions(learned(features, seed=2), [3]))


@pytest.mark.parametrize("robot", [0, 4])
@pytest.mark.parametrize("features", FEATURES)
def test_eq9_a_robot_decides_on_what_it_can_know(features, robot):
    """Its own buffer, and for the extended features the packets that it sent and decoded."""
    decided = []
    for views in mixed_views(robot):
        policy = learned(features, WALK, sharpness=4.0)
        policy.start(NUM_ROBOTS, [np.random.default_rng(b) for b in range(len(SEEDS))])
        decided.append(np.array([policy.recipients(view) for view in views]))
    np.testing.assert_array_equal(decided[0][:, :, robot], decided[1][:, :, robot])
    assert np.mean(decided[0] != decided[1]) > 0.2


@pytest.mark.parametrize("preset", [paper, reference])
def test_one_policy_flies_teams_of_any_size(tmp_path, preset):
    save_tiny(tmp_path / "policy")
    for num_robots in (2, 10, 40):
        mission = preset("random-walk", num_robots=num_robots, num_windows=12, range_ratio=0.5)
        swarm = Swarm(mission, [1])
        summary = summarise(list(rollout(swarm, make_policy(str(tmp_path / "policy"), mission))))
        assert summary.packets_attempted[0] > 0
        assert np.all(swarm.buffers.timestamp <= 12.0)


def test_the_digest_tells_whatever_changes_decisions():
    def digest(**options):
        return learned(**options).parameters["digest"]

    others = ({"seed": 2}, {"silence_logit": 0.5}, {"features": "paper"}, {"outputs": 2})
    found = {digest(), *(digest(**options) for options in others)}
    for edges in ("paper", "reference"):
        policy = GnnPolicy(tiny_network(edges=edges), make_extractor("extended", MISSION))
        found.add(policy.parameters["digest"])
    with torch.no_grad():
        policy._network.output.bias[0] += 1e-6
    assert len({*found, policy.parameters["digest"]}) == 8
    assert policy.parameters["receptive_field"] == 1
    assert digest() == digest(is_deterministic=True)


def test_threads_and_gradients_are_left_as_they_were():
    before = torch.get_num_threads()
    torch.set_num_threads(3)
    try:
        decisions(learned("paper"), [1])
        assert torch.get_num_threads() == 3
        assert torch.is_grad_enabled()
    finally:
        torch.set_num_threads(before)


# Logits over recipients, by hand.

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


@pytest.mark.parametrize("num_outputs", [1, 2])
def test_gradients_reach_every_number_that_counts(num_outputs):
    output = torch.stack([FULL, ZERO], dim=2)[:, :, :num_outputs].clone().requires_grad_()
    torch.softmax(recipient_logits(output, OWNER, ALL, 1.0), dim=1)[:, 1].sum().backward()
    assert output.grad is not None
    assert torch.all(output.grad != 0.0)
