"""What PPO sees of the networks: log-probabilities, entropies and values, robot by robot."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch.distributions import Categorical

from swarm_mj.learning.graph_vec_env import env_of
from swarm_mj.learning.ppo import draw, make_model, networks_of
from swarm_mj.learning.settings import usual_settings
from swarm_mj.mission import PRESETS
from swarm_mj.policies.gnn.own_networks import load_network

RUNS = [
    (credit, preset, sizes)
    for credit in ("robot", "team")
    for preset in ("paper", "reference")
    for sizes in ((5,), (3, 5))
]


def model_of(credit, preset, sizes, most_speech=1.0):
    """A model whose weights are large enough that decisions depend on what is seen."""
    mission = PRESETS[preset]("random-walk", num_robots=5, num_windows=20, range_ratio=0.6)
    training = usual_settings(credit, mission, sizes, seed=1)
    network = replace(training.network, latent=8, depth=2)
    training = replace(training, missions=4, network=network, most_speech=most_speech)
    model = make_model(training)
    with torch.no_grad():
        for weight in model.policy.parameters():
            weight *= 2.0
    return model, training


def after_some_windows(model, count=3):
    """What everyone sees after a few windows of the model's own decisions, and its actions."""
    env = env_of(model)
    observation = model.get_env().reset()
    for _ in range(count):
        actions, _ = model.predict(observation)
        observation, _, _, _ = env.step(actions)
    return as_tensors(observation)


def as_tensors(observation):
    return {name: torch.as_tensor(rows) for name, rows in observation.items()}


def plain_logits(output, owner, may_address, silence_logit, most_speech):
    """Over the recipients of one robot, from its network's numbers, one after the other."""
    address = output[:, 0].tolist()
    if output.shape[1] == 2:
        at_zero_power = output[may_address, 1].tolist()
        address[owner] = float(np.logaddexp.reduce([*at_zero_power, address[owner]]))
    address[owner] += silence_logit
    logits = torch.tensor([a if may_address[k] else -np.inf for k, a in enumerate(address)])
    p = torch.softmax(logits.double(), dim=0)
    speech = 1.0 - p[owner].item()
    if speech <= most_speech:
        return logits
    p *= most_speech / speech
    p[owner] = 1.0 - most_speech
    return torch.log(p).float()


def robot_by_robot(model, training):
    """Each real robot's distribution and values, from its own graph without padding, as a list.

    A row for each mission of: the robots' distributions, and their graphs' values, node by node.
    """
    policy, missions = model.policy, []
    env = env_of(model)
    for batch in env.batches:
        graphs = batch.graphs
        num_robots = batch.mission.num_robots
        for b in range(batch.num_missions):
            robots = []
            for i in range(num_robots):
                row = b * num_robots + i
                node, parent = torch.tensor(graphs.node[row]), torch.tensor(graphs.parent[row])
                seen = node[None], parent.long()[None]
                output = policy.network(*seen)[0]
                if training.shares_trunk:
                    values, output = output[:, -1], output[:, :-1]
                else:
                    values = policy.value_network(*seen)[0, :, 0]
                has_turn = graphs.has_turn[row]
                bias = 0.0 if has_turn else training.silence_logit
                bound = 1.0 if has_turn else training.most_speech
                logits = plain_logits(output, i, graphs.may_address[row], bias, bound)
                robots.append((Categorical(logits=logits), values.detach()))
            missions.append(robots)
    return missions


BOUNDED = [("robot", "paper", (3, 5), 1e-4), ("team", "reference", (3, 5), 0.3)]


@pytest.mark.parametrize(
    ("credit", "preset", "sizes", "most_speech"), [*((*run, 1.0) for run in RUNS), *BOUNDED]
)
def test_log_probabilities_entropies_and_values_are_those_of_a_loop_over_robots(
    credit, preset, sizes, most_speech
):
    model, training = model_of(credit, preset, sizes, most_speech)
    observation = after_some_windows(model)
    actions, value, log_p = model.policy(observation)
    if credit == "robot":
        actions = model.policy.considered().recipient
    again = model.policy.evaluate_actions(observation, actions)
    expected = {"value": [], "log_p": [], "entropy": []}
    is_at_bound = []
    missions = robot_by_robot(model, training)
    teams = actions.split([len(m) for m in missions]) if credit == "robot" else actions
    for robots, chosen in zip(missions, teams, strict=True):
        each = list(enumerate(robots))
        sums = credit == "team" and preset == "reference"
        of_each = {
            "value": [values.sum() if sums else values[i] for i, (_, values) in each],
            "log_p": [distribution.log_prob(chosen[i]) for i, (distribution, _) in each],
            "entropy": [distribution.entropy() for distribution, _ in robots],
        }
        is_at_bound += [d.probs[i].item() < 1.0001 - most_speech for i, (d, _) in each]
        for name, numbers in of_each.items():
            expected[name] += numbers if credit == "robot" else [sum(numbers)]
    found = [("value", value), ("log_p", log_p), *zip(expected, again, strict=True)]
    for name, numbers in found:
        close = {"atol": 2e-5, "rtol": 1e-4}
        torch.testing.assert_close(numbers.detach(), torch.stack(expected[name]), **close)
    torch.testing.assert_close(model.policy.predict_values(observation), value)
    assert most_speech == 1.0 or any(is_at_bound)


@pytest.mark.parametrize(("preset", "nodes"), [("paper", 5), ("reference", 25)])
def test_a_teams_values_ask_for_the_nodes_that_count_only(preset, nodes, monkeypatch):
    model, _ = model_of("team", preset, (5,))
    network, asked = model.policy.value_network, []

    def forward(node, parent, is_wanted):
        asked.append(is_wanted.sum(dim=1))
        return node.new_zeros(*parent.shape, 1)

    monkeypatch.setattr(network, "forward", forward)
    model.policy.predict_values(as_tensors(model.get_env().reset()))
    assert asked[0].tolist() == [nodes // 5] * 5 * 4  # by the graphs of 4 missions


def test_draws_have_the_frequencies_of_the_boltzmann_distribution():
    """Those of different robots are independent."""
    torch.manual_seed(1)
    both = draw(torch.zeros(20_000, 2, 2)).float()
    assert abs(torch.corrcoef(both.T)[0, 1]) < 4.0 / np.sqrt(20_000)
    logits = torch.tensor([1.0, 0.0, -2.0, 2.5, -1e9])
    count = 40_000
    drawn = torch.bincount(draw(logits.expand(count, 5)), minlength=5) / count
    expected = torch.softmax(logits, 0)
    error = (expected * (1 - expected) / count).sqrt()
    assert torch.all((drawn - expected).abs() <= 4.0 * error)
    assert drawn[4] == 0.0


@pytest.mark.parametrize("credit", ["robot", "team"])
def test_the_mode_is_taken_on_request(credit):
    model, _ = model_of(credit, "paper", (5,))
    observation = after_some_windows(model)
    actions, _, _ = model.policy(observation, deterministic=True)
    logits, _ = model.policy.logits_and_value(observation)
    assert torch.equal(actions, logits.argmax(-1))


@pytest.mark.parametrize("credit", ["robot", "team"])
def test_the_acting_network_is_a_copy_of_what_acts(credit):
    model, training = model_of(credit, "reference", (5,))
    dice = torch.get_rng_state()
    copied = model.policy.acting_network()
    assert torch.equal(torch.get_rng_state(), dice)
    assert copied.shape == training.network
    observation = after_some_windows(model)
    graphs = [observation[name].flatten(0, -n) for name, n in (("node", 3), ("parent", 2))]
    seen = (graphs[0], graphs[1].long())
    whole = model.policy.network(*seen)[..., : training.network.num_outputs]
    torch.testing.assert_close(copied(*seen), whole.detach(), atol=1e-6, rtol=1e-5)
    with torch.no_grad():
        for weight in model.policy.network.parameters():
            weight.zero_()
    assert all(torch.any(weight != 0.0) for weight in copied.parameters())


@pytest.mark.parametrize("credit", ["robot", "team"])
def test_robots_remember_in_training_as_they_do_in_flight(credit):
    """By `Counting`: windows since the mission began, and who a robot is; others pad teams."""
    name = "tiny_networks:Counting"
    load_network(name)
    mission = PRESETS["paper"]("random-walk", num_robots=5, num_windows=4, range_ratio=0.6)
    training = replace(
        usual_settings(credit, mission, (3, 5), seed=1), missions=4, groups=4, own_network=name
    )
    model = make_model(training)
    env = env_of(model)
    observation = model.get_env().reset()
    windows = np.zeros(4)  # since each batch began
    for _ in range(7):
        memory = observation["memory"]
        for n, (batch, count) in enumerate(zip(env.batches, windows, strict=True)):
            size = batch.shape[1]
            rows = memory[n, :size] if credit == "team" else memory[env._envs[n]]
            robots = range(size) if count else [0] * size
            assert rows.tolist() == [[count, robot] for robot in robots]
        actions, _ = model.predict(observation)
        observation, _, done, _ = env.step(actions)
        ended = [bool(done[envs].any()) for envs in env._envs]
        windows = np.where(ended, 0, windows + 1)
    assert windows.min() < windows.max()


def test_a_network_of_ones_own_acts_as_in_training_without_its_value():
    load_network("tiny_networks:Counting")
    mission = PRESETS["paper"]("random-walk", num_robots=5, num_windows=20, range_ratio=0.6)
    usual = usual_settings("robot", mission, (5,), seed=1)
    training = replace(usual, missions=4, own_network="tiny_networks:Counting")
    model = make_model(training)
    acting = networks_of(model).acting_network()
    trained = networks_of(model).network
    assert trained.output.out_features == acting.output.out_features + 1 == 2
    node, parent = torch.randn(5, 5, training.network.num_features), torch.full((5, 5), -1)
    memory = acting.remember(node, parent, torch.arange(5), torch.zeros(5, 2))
    numbers = acting(node, parent, None, memory)
    torch.testing.assert_close(numbers, trained(node, parent, None, memory)[..., :1])
    networks_of(model).take_acting_network(acting)
