"""What a config says, and everything that is none."""

import json
import math
from dataclasses import replace

import pytest
from tiny_policies import FEATURES, tiny_config, tiny_network

from swarm_mj.policies.policy_config import from_json, to_json


@pytest.fixture
def sound():
    """The content of a sound config."""
    return json.loads(to_json(tiny_config(tiny_network())))


def refused(content, complaint):
    text = content if isinstance(content, str | bytes) else json.dumps(content)
    with pytest.raises(ValueError, match=complaint) as error:
        from_json(text)
    assert len(str(error.value)) < 200


@pytest.mark.parametrize("features", FEATURES)
@pytest.mark.parametrize("commit", ["abc123", None])
def test_a_config_comes_back_as_it_was(features, commit):
    network = tiny_network(features, num_outputs=2, edges="reference", is_linear=True)
    config = tiny_config(network, features, commit=commit, silence_logit=-2.25)
    assert from_json(to_json(config)) == config
    assert from_json(to_json(config).encode()) == config


def test_a_whole_number_is_a_number(sound):
    config = from_json(json.dumps(sound | {"silence_logit": 3}))
    assert config.silence_logit == 3.0
    assert type(config.silence_logit) is float


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "Input data was truncated"),
        ("{", "Input data was truncated"),
        (b"\xff\xfe\x00\x01", "JSON is malformed"),
        ("[" * 100_000, "it is nested too deep"),
        ('{"a":' * 100_000, "it is nested too deep"),
        ("9" * 100_000, "Integer value out of range"),
        ("[]", "Expected `object`, got `array`"),
        ("null", "Expected `object`, got `null`"),
        ("0.5", "Expected `object`, got `float`"),
        ("{}", "missing required field `format`"),
        ('{"format": "another"}', "missing required field `format_version`"),
        ('{"format": "another", "format_version": 1}', 'its format must be "swarm_mj policy"'),
        ('{"format": "swarm_mj policy"}', "missing required field `format_version`"),
        ('{"format": "swarm_mj policy", "format_version": 1}', "missing required field `network`"),
    ],
)
def test_what_is_no_config(text, complaint):
    refused(text, complaint)


@pytest.mark.parametrize(
    ("key", "value", "complaint"),
    [
        ("format_version", 2, "its format_version is 2, and this swarm_mj reads 1; update it"),
        ("format_version", True, r"Expected `int`, got `bool` - at `\$\.format_version`"),
        ("format_version", 0, "Expected `int` >= 1 - at .*format_version"),
        ("format_version", 1.0, "Expected `int`, got `float` - at .*format_version"),
        ("wings", 2, "unknown field `wings`"),
        ("w" * 1000, 2, "unknown field `www"),
        ("network", [1], r"Expected `object`, got `array` - at `\$\.network`"),
        ("features", "paper", "num_features is 18, but the paper features are 8"),
        ("features", "all", "extended, or module:Name of your own, not 'all'"),
        ("features", 7, "Expected `str`, got `int` - at .*features"),
        ("silence_logit", "3", "Expected `float`, got `str` - at .*silence_logit"),
        ("silence_logit", 100.5, "silence_logit must be a number from -100 to 100, not 100.5"),
        ("silence_logit", -1e300, r"silence_logit must be a number from -100 to 100, not -1e\+300"),
        ("silence_logit", math.nan, "JSON is malformed"),
        ("silence_logit", -math.inf, "JSON is malformed"),
        ("training", [], "Expected `object`, got `array` - at .*training"),
        ("training", {"minutes": math.inf}, "JSON is malformed"),
        ("training", {"a": [json.loads("[" * 30 + "]" * 30)]}, "it is nested too deep"),
        ("evaluation", None, "Expected `object`, got `null` - at .*evaluation"),
        ("evaluation", "x" * 1000, "Expected `object`, got `str` - at .*evaluation"),
        ("commit", 5, r"Expected `str \| null`, got `int` - at .*commit"),
        ("version", None, r"Expected `str`, got `null` - at `\$\.version`"),
    ],
)
def test_what_no_config_says(sound, key, value, complaint):
    refused(sound | {key: value}, complaint)


@pytest.mark.parametrize(
    ("key", "value", "complaint"),
    [
        ("wings", 2, r"unknown field `wings` - at `\$\.network`"),
        ("latent", 6.0, r"Expected `int`, got `float` - at `\$\.network\.latent`"),
        ("latent", True, r"Expected `int`, got `bool` - at `\$\.network\.latent`"),
        ("latent", "6", "Expected `int`, got `str` - at .*latent"),
        ("latent", None, "Expected `int`, got `null` - at .*latent"),
        ("latent", 10**6, "latent must be a whole number from 1 to 1024, not 1000000"),
        ("latent", 0, "latent must be a whole number from 1 to 1024, not 0"),
        ("receptive_field", -1, "receptive_field must be a whole number from 0 to 16, not -1"),
        ("depth", 99, "depth must be a whole number from 1 to 8, not 99"),
        ("is_linear", 1, "Expected `bool`, got `int` - at .*is_linear"),
        ("edges", "all", "Invalid enum value 'all' - at .*edges"),
        ("edges", 3, "Invalid enum value 3|Expected `str`, got `int` - at .*edges"),
        ("num_outputs", 3, "num_outputs must be 1 or 2, not 3"),
        ("num_features", 8, "num_features is 8, but the extended features are 18"),
    ],
)
def test_what_no_network_is(sound, key, value, complaint):
    refused(sound | {"network": sound["network"] | {key: value}}, complaint)


def test_numbers_too_large_to_be_finite(sound):
    refused(json.dumps(sound).replace('"aoi": 4.25', '"aoi": 1e999'), "Number out of range")


def test_every_key_is_needed(sound):
    for key in sound:
        less = {name: value for name, value in sound.items() if name != key}
        refused(less, f"missing required field `{key}`")
    for key in sound["network"]:
        less = {name: value for name, value in sound["network"].items() if name != key}
        refused(sound | {"network": less}, rf"missing required field `{key}` - at `\$\.network`")


@pytest.mark.parametrize(
    "overrides",
    [{"training": {"x": math.nan}}, {"training": {"x": {1, 2}}}, {"evaluation": {"x": 1j}}],
)
def test_what_is_no_json_is_not_written(overrides):
    with pytest.raises(ValueError, match="config must be JSON all through"):
        to_json(tiny_config(tiny_network(), **overrides))


def test_a_config_made_by_hand_is_checked_too():
    config = tiny_config(tiny_network())
    for overrides, complaint in (
        ({"features": "paper"}, "num_features is 18"),
        ({"silence_logit": math.nan}, "silence_logit must be a number from -100 to 100, not nan"),
        ({"network": replace(config.network, num_outputs=3)}, "num_outputs must be 1 or 2"),
    ):
        with pytest.raises(ValueError, match=complaint):
            replace(config, **overrides)
