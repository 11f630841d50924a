"""Policies on disk: as they were saved, whole at any moment, and refused where they are not."""

import json
import math
import os
import struct
import subprocess
import sys
from dataclasses import asdict, replace

import numpy as np
import pytest
import safetensors.torch
import torch
from safetensors import safe_open
from safetensors.numpy import load_file, save_file
from tiny_policies import FEATURES, save_tiny, tiny_config, tiny_network

from swarm_mj.api.fly import fly
from swarm_mj.mission import paper
from swarm_mj.policies.gnn.extended_features import ExtendedFeatures
from swarm_mj.policies.gnn.features_of_1_0 import FEATURES_OF_1_0
from swarm_mj.policies.gnn.graphs import PaperFeatures
from swarm_mj.policies.policy_config import MlpConfig, MlpShape, model_card
from swarm_mj.policies.stored import (
    find_policy,
    load_policy,
    read_policy,
    read_weights,
    save_gnn,
    save_weights,
)

MISSION = paper("stationary", num_robots=3)
SEEN = {"num_robots": 3, "features": "paper", "num_features": 8}
PLAIN = MlpConfig(
    network=MlpShape(**SEEN, hidden=(4, 2), activation="relu", obeys_mask=False),
    training={"timesteps": 7},
    evaluation={},
    commit=None,
    version="1.2.3",
)


@pytest.fixture
def policy(tmp_path):
    """A sound GNN's file."""
    save_tiny(tmp_path / "mine.safetensors")
    return tmp_path / "mine.safetensors"


def plain_weights(seed=1):
    rng = np.random.default_rng(seed)
    shapes = PLAIN.network.tensors.items()
    return {name: rng.standard_normal(shape).astype(np.float32) for name, shape in shapes}


@pytest.fixture
def plain(tmp_path):
    """A sound plain network's file."""
    return save_weights(tmp_path / "plain", plain_weights(), PLAIN)


def refused(path, complaint):
    with pytest.raises(ValueError, match=complaint) as error:
        load_policy(path, MISSION)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def metadata_of(path):
    with safe_open(path, "numpy") as file:
        return file.metadata()


def rewritten(path, change_weights=lambda _: None, change_metadata=lambda _: None):
    weights, said = load_file(path), json.loads(metadata_of(path)["swarm_mj policy"])
    change_weights(weights)
    change_metadata(said)
    save_file(weights, path, {"swarm_mj policy": json.dumps(said)})


@pytest.mark.parametrize(
    "shape", [{}, {"is_linear": True}, {"num_outputs": 2, "edges": "both"}, {"receptive_field": 0}]
)
@pytest.mark.parametrize("features", FEATURES)
def test_a_loaded_network_gives_identical_logits(tmp_path, features, shape):
    network = save_tiny(tmp_path / "x", features, **shape)
    loaded, config = read_policy(tmp_path / "x")
    assert config == tiny_config(network, features)
    rng = np.random.default_rng(1)
    node = torch.tensor(rng.standard_normal((4, 5, network.shape.num_features)).astype(np.float32))
    parent = torch.tensor(rng.integers(-1, 5, (4, 5)))
    assert torch.equal(loaded(node, parent), network(node, parent))
    assert all(parameter.requires_grad for parameter in loaded.parameters())


@pytest.mark.parametrize("most_speech", [1.0, 0.25])
def test_a_stored_policy_keeps_its_bound_on_speech(tmp_path, most_speech):
    """An untrained robot would speak almost always."""
    network = tiny_network("paper")
    config = tiny_config(network, "paper", silence_logit=-20.0, most_speech=most_speech)
    policy = load_policy(save_gnn(tmp_path / "mine", network, config), MISSION)
    run = fly(replace(MISSION, num_windows=400), policy=policy, seed=1)
    share = run.summary.packets_attempted / (3 * 400)
    assert share == pytest.approx(most_speech, abs=4.0 * math.sqrt(0.25 * 0.75 / 1200))


def test_a_file_that_names_no_bound_has_none(tmp_path):
    """As all files had, before there was one."""
    network = tiny_network("paper")
    path = save_gnn(tmp_path / "mine", network, tiny_config(network, "paper"))

    def before(said):
        del said["config"]["most_speech"]

    rewritten(path, change_metadata=before)
    assert read_policy(path)[1].most_speech == 1.0


def test_a_plain_network_comes_back_as_it_was(plain):
    weights, config = read_weights(plain)
    assert config == PLAIN
    np.testing.assert_equal(weights, plain_weights())


def test_a_policy_is_one_file_that_others_can_read(policy):
    (written,) = policy.parent.iterdir()
    weights = {name: tensor.numpy() for name, tensor in tiny_network().state_dict().items()}
    np.testing.assert_equal(load_file(written), weights)
    said, config = json.loads(metadata_of(written)["swarm_mj policy"]), tiny_config(tiny_network())
    assert said == {
        "format": "swarm_mj policy",
        "format_version": 3,
        "kind": "gnn",
        "feature_names": list(FEATURES_OF_1_0["extended"]),
        "config": asdict(config),
        "card": model_card(config),
    }


def test_a_policy_is_the_same_bytes_every_time_and_loading_draws_no_numbers(policy):
    """Training begins with a policy, and must go on as it would have."""
    before, state = policy.read_bytes(), torch.get_rng_state()
    load_policy(policy, MISSION)
    assert torch.equal(torch.get_rng_state(), state)
    save_tiny(policy, "paper")
    assert policy.read_bytes() != before
    save_tiny(policy)
    assert policy.read_bytes() == before
    assert [path.name for path in policy.parent.iterdir()] == [policy.name]


@pytest.mark.parametrize(
    ("saved", "named"),
    [
        ("x.safetensors", "x.safetensors"),
        ("x", "x"),
        ("x.y", "x.y"),
        ("runs/x/policy", "runs/x/policy"),
        ("runs/x/policy", "runs/x"),
    ],
)
def test_a_policy_is_named_by_its_file_or_its_run(tmp_path, saved, named):
    save_tiny(tmp_path / saved, "local")
    assert read_policy(tmp_path / named)[1].features == "local"
    assert find_policy(tmp_path / named).suffix == ".safetensors"


def test_a_plain_network_flies_teams_of_its_size_alone_and_is_none_to_train_on(plain):
    with pytest.raises(ValueError, match=r"flies teams of 3 robots.* not 5; choose --robots 3"):
        load_policy(plain, paper("stationary", num_robots=5))
    with pytest.raises(ValueError, match=r"plain\.safetensors is a plain network; name one"):
        read_policy(plain)


# The features that a policy was trained on.


def as_of_1_0(path):
    """The file as version 1.0.0 wrote it, without the names of its features."""

    def change(said):
        del said["feature_names"]
        said["format_version"] = 2

    rewritten(path, change_metadata=change)


@pytest.mark.parametrize("features", FEATURES)
def test_files_of_1_0_fly_as_those_that_name_their_features(tmp_path, features):
    save_tiny(tmp_path / "x", features)
    now = load_policy(tmp_path / "x", MISSION)
    as_of_1_0(tmp_path / "x.safetensors")
    assert load_policy(tmp_path / "x", MISSION).parameters == now.parameters


@pytest.mark.parametrize("is_old", [False, True])
def test_features_in_another_order_are_refused(policy, monkeypatch, is_old):
    """The network would fly, and worse, without a word."""
    if is_old:
        as_of_1_0(policy)
    names = ExtendedFeatures.names
    monkeypatch.setattr(ExtendedFeatures, "names", (*names[:2], names[3], names[2], *names[4:]))
    refused(policy, 'features: number 3 of them was "age of T" and is "distance" now; use it with')


def test_one_feature_more_is_refused_by_its_name_and_not_by_a_number(policy, monkeypatch):
    monkeypatch.setattr(ExtendedFeatures, "names", (*ExtendedFeatures.names, "battery"))
    refused(policy, 'number 19 of them was nothing and is "battery" now')


def test_a_plain_network_keeps_the_names_of_its_features_too(plain, monkeypatch):
    monkeypatch.setattr(PaperFeatures, "names", PaperFeatures.names[::-1])
    refused(plain, 'other paper features: number 1 of them was "is oneself" and is "L" now')


@pytest.mark.slow
def test_a_gnn_is_loaded_without_torch_until_it_flies(policy):
    code = (
        "import sys; from pathlib import Path; import swarm_mj; "
        "from swarm_mj.policies.stored import load_policy; "
        f"policy = load_policy(Path({str(policy)!r}), swarm_mj.paper(num_robots=3)); "
        "print(policy.parameters['digest'], 'torch' in sys.modules); "
        "swarm_mj.fly(policy=policy, num_robots=3, num_windows=2, record=False); "
        "print(policy.parameters['digest'], 'torch' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    digest = load_policy(policy, MISSION).parameters["digest"]
    assert done.stdout.split() == [digest, "False", digest, "True"]


def test_a_gnn_without_torch_says_what_to_install(policy, monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(ModuleNotFoundError, match=r"policy .*mine\.safetensors needs torch.*fly"):
        load_policy(policy, MISSION)


# What is no policy.


@pytest.mark.parametrize("kind", ["nothing", "pipe", "/dev/zero", "itself", "empty"])
def test_no_policy(tmp_path, kind):
    path = tmp_path / "x.safetensors"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "empty":
        path.mkdir()
    elif kind != "nothing":
        path.symlink_to(path if kind == "itself" else kind)
    refused(path, "there is no policy .* name a .safetensors file, or the folder of a run")


def test_a_folder_of_policies_lists_them(tmp_path):
    names = ("a/policy", "b/policy", "c")
    files = [tmp_path / f"{name}.safetensors" for name in names]
    for file in files:
        file.parent.mkdir(exist_ok=True)
        file.touch()
    with pytest.raises(ValueError, match="holds policies; name one of them") as refused:
        find_policy(tmp_path)
    shown = str(refused.value).partition("them: ")[2]
    assert shown == ", ".join(map(str, files))


def test_an_oversized_file(policy):
    """Sparse: it would take long to read, and is not read."""
    with policy.open("r+b") as file:
        file.truncate(64_000_001)
    refused(policy, "may have up to 64000000 bytes, not 64000001")


@pytest.mark.parametrize(
    "data",
    [
        *(0.0, 0.001, 0.02, 0.5, 0.999),  # of a sound file
        *(b"PK\x03\x04 a pickle of torch's", b"\x80\x04", struct.pack("<Q", 2**63) + b"{}"),
        b"\0" * 64,
    ],
)
def test_a_file_that_was_cut_off_or_of_another_format(policy, data):
    sound = policy.read_bytes()
    policy.write_bytes(data if isinstance(data, bytes) else sound[: int(data * len(sound))])
    refused(policy, "it is damaged, or no safetensors file .*; copy it again, or make one")


@pytest.mark.parametrize(
    ("metadata", "complaint"),
    [
        (None, "does not say of which policy"),
        ({"format": "pt"}, "does not say of which policy"),
        ({"swarm_mj policy": "[]"}, "Expected"),
        ({"swarm_mj policy": "[" * 100_000}, "it is nested too deep"),
        ({"swarm_mj policy": "{}"}, "missing required field `format`"),
        (
            {"swarm_mj policy": '{"format": "another", "format_version": 1}'},
            'its format must be "swarm_mj policy", not .another.; copy it again, or make',
        ),
    ],
)
def test_weights_that_are_no_policys(policy, metadata, complaint):
    save_file(load_file(policy), policy, metadata)
    refused(policy, complaint)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda w: w.pop("output.bias"), "it lacks the tensor output.bias"),
        (lambda w: w.update(wings=np.zeros(2)), "it has an unknown tensor wings"),
        (
            lambda w: w.update({"output.bias": np.zeros(2, np.float32)}),
            r"tensor output.bias must be \[1\] of float32, not \[2\] of float32",
        ),
        (
            lambda w: w.update({"output.bias": np.zeros(1)}),
            r"tensor output.bias must be .*, not \[1\] of float64",
        ),
        (lambda w: w["output.bias"].fill(np.nan), "output.bias has numbers that are not finite"),
        (lambda w: w["output.weight"][0].fill(-np.inf), "output.weight has numbers that are not"),
    ],
)
def test_weights_of_another_network(policy, change, complaint):
    rewritten(policy, change_weights=change)
    refused(policy, complaint)


def test_weights_of_a_type_that_numpy_lacks(policy):
    bias = {"output.bias": torch.zeros(1, dtype=torch.bfloat16)}
    safetensors.torch.save_file(bias, policy, metadata_of(policy))
    refused(policy, "it is damaged, or no safetensors file")


def network_with(**its):
    return lambda said: said["config"]["network"].update(its)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda s: s.update(format_version=4), "format_version is 4, and this .* reads 3; update"),
        (lambda s: s.update(kind="cnn"), "Invalid enum value 'cnn'"),
        (lambda s: s.update(kind="gnn"), "missing required field|unknown field"),
        (lambda s: s.update(wings=2), "unknown field `wings`"),
        (lambda s: s["config"].pop("training"), "missing required field `training`"),
        (lambda s: s["config"].update(extra=1), "unknown field `extra`"),
        (network_with(hidden=[4, 10**9]), "hidden must be a whole"),
        (network_with(activation="os.system"), "os.system"),
        (network_with(features="mine"), "features must be one of"),
        (network_with(features="os:system"), "add --features os:system"),
        (network_with(num_features=7), "but the paper features are 8"),
        (network_with(hidden=[4, 3]), r"tensor [12]\.\w+ must be"),
        (network_with(hidden=[4]), "it has an unknown tensor 2"),
        (network_with(hidden=[4, 2, 2]), "it lacks the tensor 3"),
    ],
)
def test_plain_networks_that_are_not_sound(plain, change, complaint):
    rewritten(plain, change_metadata=change)
    refused(plain, complaint)


# What is not saved.


@pytest.mark.parametrize(
    ("overrides", "complaint"),
    [
        ({"training": {"rate": float("nan")}}, "not JSON compliant"),
        (
            {"training": {"log": "x" * 64_000_000}},
            r"mine\.safetensors may have up to 64000000 bytes",
        ),
        ({"network": tiny_network(latent=7).shape}, r"tensor .* must be \[7\b"),
        ({"output": torch.tensor([np.nan])}, "not finite"),
        ({"output": torch.zeros(1).double()}, "must be .* of float32, not"),
    ],
)
def test_what_could_not_be_loaded_is_not_saved(policy, overrides, complaint):
    network, its = tiny_network(seed=5), dict(overrides)
    network.output.bias.data = its.pop("output", network.output.bias.data)
    with pytest.raises(ValueError, match=complaint):
        save_gnn(policy, network, replace(tiny_config(network), **its), card="# Short")
    assert torch.equal(read_policy(policy)[0].output.weight, tiny_network().output.weight)


def test_a_policy_may_be_a_link_as_in_caches(policy, tmp_path):
    (tmp_path / "link").symlink_to(policy)
    assert read_policy(tmp_path / "link")[1] == read_policy(policy)[1]


@pytest.mark.slow
def test_a_plain_network_flies_without_torch(plain):
    code = (
        "import sys; sys.modules['torch'] = None; import swarm_mj; "
        f"swarm_mj.fly('stationary', policy={str(plain)!r}, num_robots=3, num_windows=5, "
        "record=False)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
