"""A run's settings: the usual ones of both kinds of credit, what is refused, and JSON."""

import json
from dataclasses import asdict, replace

import pytest
import torch
from small_runs import small_training

from swarm_mj.learning.settings import PpoSettings, Training, usual_settings
from swarm_mj.mission import PRESETS, paper, reference
from swarm_mj.policies.gnn.network import AggregationGnn
from swarm_mj.system.reading import read_json

CREDIT_WAYS = ("robot", "team")
CREDITS = [(credit, preset) for credit in CREDIT_WAYS for preset in PRESETS]


@pytest.mark.parametrize(("credit", "preset"), CREDITS)
def test_settings_come_back_from_json_as_they_were(credit, preset):
    training = usual_settings(credit, PRESETS[preset]("random-walk"), (10, 40), seed=2**62)
    assert read_json(json.dumps(asdict(training)), Training) == training


def test_settings_are_read_by_their_former_names_and_without_fields_that_are_newer():
    """As a run's `settings.json` of an earlier release has them."""
    training = usual_settings("team", paper("stationary", failure_fraction=0.2), (10,))
    stored = asdict(training)
    stored["arm"] = stored.pop("credit_assignment")
    stored["parts"] = stored.pop("components")
    stored["mission"]["switched_off"] = stored["mission"].pop("failure_fraction")
    stored["mission"]["known"] = stored["mission"].pop("prior_knowledge")
    del stored["mission"]["map_offset_m"], stored["ppo"]["considered"]
    assert read_json(json.dumps(stored), Training) == training
    del stored["robots"]
    with pytest.raises(ValueError, match="missing required field `robots`"):
        read_json(json.dumps(stored), Training)


def test_credit_per_team_is_the_papers():
    """III-C: K = 5; what PPO is given is tested beside PPO."""
    training = usual_settings("team", paper("stationary"), (40,))
    network = training.network
    assert (network.receptive_field, network.latent, network.depth) == (5, 64, 3)
    assert not network.is_linear
    assert (training.features, network.edges, network.num_outputs) == ("paper", "reference", 1)
    assert not training.shares_trunk


def test_credit_per_team_under_the_reference_preset_is_the_authors():
    training = usual_settings("team", reference("stationary"), (40,))
    network = training.network
    assert (training.features, network.edges, network.num_outputs) == ("reference", "reference", 2)
    assert training.silence_logit == 0.0


def test_missions_of_training_have_at_most_the_windows_of_those_asked_for():
    training = usual_settings("robot", paper("stationary", num_windows=300), (40,))
    for given, least, most in (
        ((), 300, 300),
        ((200,), 200, 200),
        ((301,), 300, 300),
        ((40, 250), 40, 250),
        ((40, 301), 40, 300),
        ((301, 400), 300, 300),
    ):
        its = replace(training, train_windows=given)
        assert (its.least_windows, its.most_windows) == (least, most)


def test_a_horizon_that_cannot_be_is_refused():
    assert PpoSettings(num_steps=4, horizon=4).horizon == 4
    with pytest.raises(ValueError, match="credit-horizon 5 is longer than a rollout; choose at m"):
        PpoSettings(num_steps=4, horizon=5)
    robot, team = (usual_settings(credit, paper("stationary"), (40,)) for credit in CREDIT_WAYS)
    for training in (replace(robot, ppo=replace(robot.ppo, horizon=1, discount=0.5)), team):
        longer = replace(training.ppo, horizon=2)
        with pytest.raises(ValueError, match="credit-horizon sums up credits per robot, without a"):
            replace(training, ppo=longer)


def test_settings_that_say_nothing_of_a_horizon_had_none():
    training = usual_settings("robot", paper("stationary"), (40,))
    stored = asdict(training)
    assert stored["ppo"].pop("horizon") > 1
    assert read_json(json.dumps(stored), Training).ppo.horizon == 1


def test_silence_is_dropped_only_where_it_earns_nothing():
    robot = usual_settings("robot", paper("stationary"), (40,))
    assert robot.ppo.discount == 0.0
    assert robot.considers_speech
    discounted = replace(robot.ppo, discount=0.5, horizon=1)
    assert not replace(robot, ppo=discounted).considers_speech
    assert not small_training("team").considers_speech


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"missions": 4097}, "missions must be a whole number from 1 to 4096, not 4097"),
        ({"seed": 2**63}, "not 9223372036854775808"),
        ({"evaluate_every": 0}, "evaluation interval must be a whole number from 1"),
        ({"robots": (10, 1)}, "robots must be a whole number from 2 to 200, not 1"),
        ({"reward": "velocity-variance"}, "reward velocity-variance is a team's"),
        (
            {"unknown_age": -1.0},
            r"unknown-age must be a number from 0 to 10000 \[windows\], not -1",
        ),
        ({"train_windows": (50, 40)}, "one number, or the least and the most: 50 40"),
        ({"train_windows": (1, 2, 3)}, "one number, or the least and the most: 1 2 3"),
        ({"robots": ()}, "robots must have at least 1 size"),
        ({"features": "paper"}, "num_features is 18, but the paper features are 8"),
    ],
)
def test_what_is_out_of_range_is_refused(changes, complaint):
    with pytest.raises(ValueError, match=complaint):
        replace(small_training(), **changes)


def test_kinds_are_each_mission_with_each_size_of_the_team():
    first, second = paper("stationary", range_ratio=0.5), paper("flocking")
    training = replace(usual_settings("robot", first, (10, 20)), other_missions=(second,))
    assert training.all_missions == (first, second)
    assert [(each.task, each.num_robots) for each in training.kinds] == [
        ("stationary", 10),
        ("stationary", 20),
        ("flocking", 10),
        ("flocking", 20),
    ]
    assert read_json(json.dumps(asdict(training)), Training) == training


def test_other_missions_are_read_by_former_names_and_refuse_unknown_ones():
    first, second = paper("stationary"), paper("stationary", failure_fraction=0.2)
    training = replace(usual_settings("robot", first, (10,)), other_missions=(second,))
    stored = asdict(training)
    other = dict(stored["other_missions"][0])
    other["switched_off"] = other.pop("failure_fraction")
    assert read_json(json.dumps(stored | {"other_missions": [other]}), Training) == training
    other["wings"] = 2
    with pytest.raises(ValueError, match=r"unknown field `wings` - at `\$\.other_missions\[0\]`"):
        read_json(json.dumps(stored | {"other_missions": [other]}), Training)


def test_missions_that_cannot_be_trained_on_together_are_refused():
    mission = paper("stationary")
    usual = usual_settings("robot", mission, (40,))
    with pytest.raises(ValueError, match="must have as many windows, not 500 and 400"):
        replace(usual, other_missions=(replace(mission, num_windows=400),))
    other = (reference("stationary"),)
    assert replace(usual, other_missions=other).all_missions == (mission, *other)
    with pytest.raises(ValueError, match="credit team takes one preset, not paper and reference"):
        replace(usual_settings("team", mission, (40,)), other_missions=other)
    with pytest.raises(ValueError, match="credit-scaling is of credits per robot; choose credit"):
        replace(usual_settings("team", mission, (40,)), credit_scaling="kind")


def test_unknown_teammates_count_in_credits_per_robot_alone():
    with pytest.raises(ValueError, match="unknown-age counts in credits per robot; choose credit"):
        replace(small_training("team"), unknown_age=20.0)


@pytest.mark.parametrize("preset", [paper, reference])
def test_whom_a_robot_addresses_can_depend_on_where_it_is(preset):
    """The text's edges lead from children to parents: the robot's own state reached nobody."""
    mission = preset("stationary", num_robots=4)
    torch.manual_seed(0)
    network = AggregationGnn(usual_settings("team", mission, (4,)).network)
    node = torch.rand(1, 4, network.shape.num_features)
    parent = torch.tensor([[-1, 0, 1, 0]])
    moved = node.clone()
    moved[0, 0] += 1.0
    change = (network(moved, parent) - network(node, parent)).abs().amax(dim=2)
    assert torch.all(change > 0.0)
