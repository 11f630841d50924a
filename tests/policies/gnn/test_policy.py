"""A learned policy flies: reproducibly, locally, in teams of any size."""

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
from swarm_mj.policies.learned import sample
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


@pytest.mark.parametrize("most_speech", [0.1, 0.4])
def test_an_untrained_robot_speaks_no_more_often_than_it_may(most_speech):
    """Without a bound all would speak in every window, and nobody would hear anything."""
    policy = learned("turns", silence_logit=-10.0, most_speech=most_speech)
    recipient = decisions(policy, range(10))
    speaks = recipient != np.arange(MISSION.num_robots)
    error = np.sqrt(most_speech * (1.0 - most_speech) / speaks.size)
    assert abs(speaks.mean() - most_speech) < 4.0 * error


def test_a_bound_that_no_robot_meets_changes_no_flight():
    """Sharp, but all but silent robots."""
    free = learned("turns", silence_logit=3.0, sharpness=1.0)
    bounded = learned("turns", silence_logit=3.0, sharpness=1.0, most_speech=0.9)
    np.testing.assert_array_equal(decisions(bounded, [1, 2]), decisions(free, [1, 2]))


def test_the_digest_tells_whatever_changes_decisions():
    def digest(**options):
        return learned(**options).parameters["digest"]

    others = ({"seed": 2}, {"silence_logit": 0.5}, {"features": "paper"}, {"outputs": 2})
    others = (*others, {"most_speech": 0.5})
    found = {digest(), *(digest(**options) for options in others)}
    for edges in ("paper", "reference"):
        policy = GnnPolicy(tiny_network(edges=edges), make_extractor("extended", MISSION))
        found.add(policy.parameters["digest"])
    with torch.no_grad():
        policy._network.output.bias[0] += 1e-6
    assert len({*found, policy.parameters["digest"]}) == 9
    assert policy.parameters["receptive_field"] == 1
    assert digest() == digest(is_deterministic=True) == digest(most_speech=1.0)


def test_threads_and_gradients_are_left_as_they_were():
    before = torch.get_num_threads()
    torch.set_num_threads(3)
    try:
        decisions(learned("paper"), [1])
        assert torch.get_num_threads() == 3
        assert torch.is_grad_enabled()
    finally:
        torch.set_num_threads(before)
