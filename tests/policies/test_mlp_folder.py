"""Plain networks on disk: as they were stored, and refused where they are not."""

import json
import subprocess
import sys

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from swarm_mj.mission import paper
from swarm_mj.policies.mlp import MlpPolicy, MlpShape
from swarm_mj.policies.mlp_folder import MlpConfig, load_mlp, read_mlp, save_mlp
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.stored import read_policy

MISSION = paper("stationary", num_robots=3)
SHAPE = MlpShape(
    num_robots=3,
    features="paper",
    num_features=8,
    hidden=(4, 2),
    activation="relu",
    obeys_mask=False,
)
CONFIG = MlpConfig(network=SHAPE, training={"timesteps": 7}, version="1.2.3")


def some_weights(seed=1):
    rng = np.random.default_rng(seed)
    return {n: rng.standard_normal(size).astype(np.float32) for n, size in SHAPE.tensors().items()}


@pytest.fixture
def policy(tmp_path):
    """A sound policy's folder."""
    save_mlp(tmp_path / "policy", some_weights(), CONFIG)
    return tmp_path / "policy"


def refused(folder, complaint):
    with pytest.raises(ValueError, match=complaint) as error:
        make_policy(str(folder), MISSION)
    assert str(folder) in str(error.value)
    assert "\n" not in str(error.value)


def test_what_is_read_is_what_was_stored(policy):
    weights, config = read_mlp(policy)
    assert config == CONFIG
    assert weights.keys() == SHAPE.tensors().keys()
    for name, values in some_weights().items():
        np.testing.assert_array_equal(weights[name], values)
    card = (policy / "README.md").read_text()
    assert "4 and 2 hidden units" in card
    assert "timesteps: 7" in card


@pytest.mark.parametrize("is_deterministic", [True, False])
def test_the_command_line_finds_it(policy, is_deterministic):
    found = make_policy(str(policy), MISSION, is_deterministic=is_deterministic)
    assert isinstance(found, MlpPolicy)
    assert found.parameters["is_deterministic"] == is_deterministic
    assert found.uses.endswith("by a trained network")


def test_a_policy_there_is_replaced_and_nothing_else(policy):
    save_mlp(policy, some_weights(2), CONFIG)
    np.testing.assert_array_equal(read_mlp(policy)[0]["0.bias"], some_weights(2)["0.bias"])
    (policy / "mine.txt").write_text("mine")
    with pytest.raises(ValueError, match=r"holds mine.txt, which is no policy's"):
        save_mlp(policy, some_weights(), CONFIG)


def test_other_teams_are_refused(policy):
    with pytest.raises(ValueError, match=r"flies teams of 3 robots.* not 5; choose --robots 3"):
        load_mlp(policy, paper("stationary", num_robots=5))


def test_it_is_no_gnn_to_train_on(policy):
    with pytest.raises(ValueError, match='its format must be "swarm_mj policy"'):
        read_policy(policy)


def changed(policy, change):
    document = json.loads((policy / "config.json").read_text())
    change(document)
    (policy / "config.json").write_text(json.dumps(document))


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda d: d.update(format_version=2), "its format_version is 2"),
        (lambda d: d.pop("training"), "missing required field `training`"),
        (lambda d: d.update(extra=1), "unknown field `extra`"),
        (lambda d: d["network"].update(hidden=[4, 10**9]), "hidden must be a whole number"),
        (lambda d: d["network"].update(activation="os.system"), "os.system"),
        (lambda d: d["network"].update(features="mine"), "features must be one of"),
        (lambda d: d["network"].update(features="os:system"), "add --features os:system$"),
        (lambda d: d["network"].update(num_features=7), "is 7, but the paper features are 8"),
        (lambda d: d["network"].update(hidden=[4, 3]), r"tensor [12]\.\w+ must be"),
        (lambda d: d["network"].update(hidden=[4]), "it has an unknown tensor 2"),
        (lambda d: d["network"].update(hidden=[4, 2, 2]), "it lacks the tensor 3"),
        (lambda d: d["network"].update(num_robots=4), r"tensor [02]\.\w+ must be"),
    ],
)
def test_configs_that_are_not_sound(policy, change, complaint):
    changed(policy, change)
    refused(policy, complaint)


def reweighted(policy, change):
    weights = load_file(policy / "model.safetensors")
    change(weights)
    save_file(weights, policy / "model.safetensors")


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda w: w.pop("0.bias"), "it lacks the tensor 0.bias"),
        (lambda w: w.update(x=np.zeros(1, dtype=np.float32)), "it has an unknown tensor x"),
        (lambda w: w.update({"0.bias": np.zeros(4)}), "of float32, not .* of float64"),
        (
            lambda w: w.update({"0.bias": np.full(4, np.nan, dtype=np.float32)}),
            "numbers that are not finite",
        ),
    ],
)
def test_weights_that_are_not_sound(policy, change, complaint):
    reweighted(policy, change)
    refused(policy, complaint)


def test_damaged_weights(policy):
    (policy / "model.safetensors").write_bytes(b"\x80\x04pickle")
    refused(policy, "it is damaged, or no safetensors file")
    (policy / "model.safetensors").unlink()
    refused(policy, "there is no file")


def test_weights_of_another_shape_are_not_stored(tmp_path):
    with pytest.raises(ValueError, match=r"it lacks the tensor 0\.bias"):
        save_mlp(tmp_path / "x", {k: v for k, v in some_weights().items() if k != "0.bias"}, CONFIG)
    assert not (tmp_path / "x").exists()


def test_it_flies_without_torch(policy):
    code = (
        "import sys; sys.modules['torch'] = None; import swarm_mj; "
        f"swarm_mj.fly('stationary', policy={str(policy)!r}, num_robots=3, num_windows=5, "
        "record=False)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
