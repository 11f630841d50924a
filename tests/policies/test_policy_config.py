"""What a config says, everything that is none, and the card that says it in words."""

import itertools
import json
import math
from dataclasses import asdict, replace

import pytest
from tiny_policies import FEATURES, tiny_config, tiny_network

from swarm_mj.policies.gnn.own_networks import empty_network
from swarm_mj.policies.policy_config import GnnConfig, GnnShape, MlpConfig, MlpShape, model_card
from swarm_mj.system.reading import read_json


@pytest.mark.parametrize("features", FEATURES)
@pytest.mark.parametrize("commit", ["abc123", None])
def test_a_config_comes_back_as_it_was(features, commit):
    network = tiny_network(features, num_outputs=2, edges="reference", is_linear=True)
    config = tiny_config(network, features, commit=commit, silence_logit=-2.25, most_speech=0.5)
    assert read_json(json.dumps(asdict(config)), GnnConfig) == config


ABSENT = object()
LACKING = [
    (key, ABSENT, f"missing required field `{key.rpartition('.')[2]}`")
    for key in ("network", "features", "commit", "network.num_features")
]


@pytest.mark.parametrize(
    ("key", "value", "complaint"),
    [
        *LACKING,
        ("wings", 2, "unknown field `wings`"),
        ("network", [1], r"Expected `object`, got `array` - at `\$\.network`"),
        ("features", "paper", "num_features is 18, but the paper features are 8"),
        ("features", "all", "extended, or module:Name of your own, not 'all'"),
        ("silence_logit", 100.5, "silence_logit must be a number from -100 to 100, not 100.5"),
        ("most_speech", 1.5, "most_speech must be a number from 1e-09 to 1, not 1.5"),
        ("most_speech", 0.0, "most_speech must be a number from 1e-09 to 1, not 0"),
        ("silence_logit", math.nan, "JSON is malformed"),
        ("training", [], "Expected `object`, got `array` - at .*training"),
        ("commit", 5, r"Expected `str \| null`, got `int` - at .*commit"),
        ("network.wings", 2, r"unknown field `wings` - at `\$\.network`"),
        ("network.latent", 6.0, r"Expected `int`, got `float` - at `\$\.network\.latent`"),
        ("network.edges", "all", "Invalid enum value 'all' - at .*edges"),
        ("network.num_outputs", 3, "num_outputs must be 1 or 2, not 3"),
        ("network.num_features", 8, "num_features is 8, but the extended features are 18"),
    ],
)
def test_what_is_no_config(key, value, complaint):
    content = asdict(tiny_config(tiny_network()))
    part, _, name = key.rpartition(".")
    its = content[part] if part else content
    its[name] = value
    if value is ABSENT:
        del its[name]
    with pytest.raises(ValueError, match=complaint) as error:
        read_json(json.dumps(content), GnnConfig)
    assert len(str(error.value)) < 200


def test_the_card_says_how_to_fly_a_policy_and_all_that_its_config_holds():
    training = {"mission": {"task": "random-walk"}, "command": "swarm-mj train\n  --robots 10"}
    config = tiny_config(tiny_network(), training=training)
    written = model_card(config)
    assert "    swarm-mj fly --policy FILE --task random-walk\n" in written
    assert "`extended` features" in written
    said = written.partition("```json\n")[2].partition("\n```")[0]
    assert json.loads(said) == asdict(config)
    assert sum(line.startswith("#") for line in written.splitlines()) == 1
    assert "--task TASK" in model_card(replace(config, training={}))


def test_the_card_of_a_plain_network_says_how_to_fly_it_as_it_was_trained():
    shape = {"num_robots": 3, "num_features": 2, "hidden": (4, 2), "activation": "relu"}
    config = MlpConfig(
        network=MlpShape(features="my_features:Ages", obeys_mask=True, **shape),
        training={"mission": {"task": "random-walk"}},
        evaluation={},
        commit=None,
        version="1.2.3",
    )
    written = model_card(config)
    flags = "--task random-walk --robots 3 --features my_features:Ages"
    assert f"    swarm-mj fly --policy FILE {flags}\n" in written
    assert "It flies teams of 3 robots only." in written


@pytest.mark.parametrize(
    ("kind", "its", "complaint"),
    [
        (GnnShape, {"num_features": 0}, "num_features must be a whole number from 1 to 1024"),
        (GnnShape, {"num_outputs": 1025}, "num_outputs must be a whole number from 1 to 1024, not"),
        (GnnShape, {"latent": 0}, "latent must be a whole number from 1 to 1024"),
        (GnnShape, {"depth": 9}, "depth must be a whole number from 1 to 8, not 9"),
        (GnnShape, {"receptive_field": -1}, "receptive_field must be a whole number from 0 to 16"),
        (MlpShape, {"num_robots": 1}, "num_robots must be a whole number from 2 to 1000, not 1"),
        (MlpShape, {"hidden": (0,)}, "hidden must be a whole number from 1 to 4096, not 0"),
        (MlpShape, {"features": "mine"}, "features must be one of"),
        (MlpShape, {"num_features": 18}, "num_features is 18, but the paper features are 8"),
    ],
)
def test_a_shape_refuses_what_is_out_of_range(kind, its, complaint):
    usual = {"num_features": 8}
    if kind is MlpShape:
        usual |= {"num_robots": 4, "features": "paper", "hidden": (3,), "activation": "tanh"}
        usual |= {"obeys_mask": True}
    with pytest.raises(ValueError, match=complaint):
        kind(**(usual | its))


@pytest.mark.parametrize(
    ("receptive_field", "is_linear", "has_core"),
    [(0, False, False), (0, True, False), (2, True, False), (1, False, True)],
)
def test_only_a_block_that_is_applied_and_not_linear_learns(receptive_field, is_linear, has_core):
    shape = GnnShape(num_features=3, receptive_field=receptive_field, is_linear=is_linear)
    assert shape.has_core == has_core


SHAPES = list(itertools.product((1, 2, 3), (0, 1, 4), (False, True), (1, 2)))


@pytest.mark.parametrize(("depth", "receptive_field", "is_linear", "num_outputs"), SHAPES)
def test_a_shape_knows_its_tensors_without_torch(depth, receptive_field, is_linear, num_outputs):
    shape = GnnShape(
        num_features=3,
        num_outputs=num_outputs,
        latent=5,
        depth=depth,
        receptive_field=receptive_field,
        is_linear=is_linear,
    )
    state = empty_network(shape).state_dict()
    assert shape.tensors == {name: tuple(tensor.shape) for name, tensor in state.items()}
