"""Policies on disk: as they were saved, whole at any moment, and refused where they are not."""

import json
import os
import signal
import struct
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from safetensors import safe_open
from safetensors.torch import load_file, save_file
from tiny_policies import FEATURES, save_tiny, tiny_config, tiny_network

from swarm_mj.mission import paper
from swarm_mj.policies.stored import load_policy, read_policy, save_policy

MISSION = paper("stationary", num_robots=5)
CONFIG, WEIGHTS, CARD = "config.json", "model.safetensors", "README.md"


@pytest.fixture
def policy(tmp_path):
    """A sound policy's folder."""
    save_tiny(tmp_path / "policy")
    return tmp_path / "policy"


def refused(folder, complaint):
    with pytest.raises(ValueError, match=complaint) as error:
        load_policy(folder, MISSION)
    assert str(folder) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "shape",
    [{}, {"is_linear": True}, {"num_outputs": 2, "edges": "both"}, {"receptive_field": 0}],
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


def test_a_policy_is_three_files_that_others_can_read(policy):
    assert sorted(path.name for path in policy.iterdir()) == [CARD, CONFIG, WEIGHTS]
    network = tiny_network()
    weights = load_file(policy / WEIGHTS)
    assert all(torch.equal(weights[name], t) for name, t in network.state_dict().items())
    config = json.loads((policy / CONFIG).read_text())
    assert config["format"] == "swarm_mj policy"
    assert config["format_version"] == 1
    assert config["network"]["receptive_field"] == 1
    assert config["training"]["seed"] == 3


def test_loading_draws_no_random_numbers(policy):
    """Training begins with it, and must go on as it would have."""
    state = torch.get_rng_state()
    load_policy(policy, MISSION)
    assert torch.equal(torch.get_rng_state(), state)


def test_saving_again_replaces_the_policy(policy):
    network = save_tiny(policy, "paper", seed=2)
    assert read_policy(policy)[0].shape == network.shape
    assert [path.name for path in policy.parent.iterdir()] == [policy.name]


def test_a_policy_left_aside_by_a_kill_is_loaded(policy):
    policy.rename(policy.with_name(".policy.old"))
    assert read_policy(policy)[1].features == "extended"


def test_a_card_of_ones_own(tmp_path):
    network = tiny_network()
    save_policy(tmp_path / "x", network, tiny_config(network), "# Mine\n")
    assert (tmp_path / "x" / CARD).read_text() == "# Mine\n"


SAVE_ON_AND_ON = """
import itertools, sys
sys.path.insert(0, sys.argv[2])
from pathlib import Path
from tiny_policies import save_tiny
for seed in itertools.count():
    save_tiny(Path(sys.argv[1]), "paper" if seed % 2 else "extended", seed=seed % 2)
"""


@pytest.mark.parametrize("wait_s", [0.05, 0.11, 0.23])
def test_a_writer_killed_at_any_moment_leaves_a_policy(tmp_path, wait_s):
    folder = tmp_path / "policy"
    here = os.path.dirname(os.path.dirname(__file__))
    writer = subprocess.Popen([sys.executable, "-c", SAVE_ON_AND_ON, str(folder), here])
    while writer.poll() is None and not folder.exists():
        time.sleep(0.01)
    time.sleep(wait_s)
    writer.send_signal(signal.SIGKILL)
    assert writer.wait() == -signal.SIGKILL
    network, config = read_policy(folder)
    features, seed = config.features, {"paper": 1, "extended": 0}[config.features]
    saved = tiny_network(features, seed).state_dict()
    assert all(torch.equal(t, saved[name]) for name, t in network.state_dict().items())
    save_tiny(folder, "reference")
    assert read_policy(folder)[1].features == "reference"


# What is no policy.


def test_no_directory(tmp_path):
    refused(tmp_path / "x", "does not exist; name a directory .* such as runs/NAME/policy")


def test_a_file(policy):
    refused(policy / CONFIG, "is a file; name the directory that holds the policy")


@pytest.mark.parametrize("name", [CONFIG, WEIGHTS])
def test_a_missing_file(policy, name):
    (policy / name).unlink()
    refused(policy, f"{name}: there is no file .* or make one with `swarm-mj train`")


@pytest.mark.parametrize(("name", "limit"), [(CONFIG, 1_000_000), (WEIGHTS, 64_000_000)])
def test_an_oversized_file(policy, name, limit):
    """Sparse: it would take long to read, and is not read."""
    with (policy / name).open("r+b") as file:
        file.truncate(10**13 if name == WEIGHTS else limit + 1)
    refused(policy, f"{name}: file .*{name} may have up to {limit} bytes, not 1")


def test_what_is_no_config(policy):
    (policy / CONFIG).write_text('{"format": "another", "format_version": 1}')
    refused(
        policy,
        f'{CONFIG}: its format must be "swarm_mj policy", not .another.; copy it again, or make',
    )


def test_a_file_of_the_largest_size_is_read(policy):
    text = (policy / CONFIG).read_text()
    (policy / CONFIG).write_text(text + " " * (1_000_000 - len(text)))
    load_policy(policy, MISSION)


# What are no weights.


def with_weights(policy, change):
    tensors = load_file(policy / WEIGHTS)
    change(tensors)
    save_file(tensors, policy / WEIGHTS)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.02, 0.5, 0.999])
def test_truncated_weights(policy, share):
    data = (policy / WEIGHTS).read_bytes()
    (policy / WEIGHTS).write_bytes(data[: int(share * len(data))])
    refused(policy, "it is damaged, or no safetensors file")


@pytest.mark.parametrize(
    "data", [b"PK\x03\x04 a pickle of torch's", struct.pack("<Q", 2**63) + b"{}", b"\0" * 64]
)
def test_weights_of_another_format(policy, data):
    (policy / WEIGHTS).write_bytes(data)
    refused(policy, "it is damaged, or no safetensors file")


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda t: t.pop("output.bias"), "it lacks the tensor output.bias"),
        (lambda t: t.update(wings=torch.zeros(2)), "it has an unknown tensor wings"),
        (
            lambda t: t.update({"output.bias": torch.zeros(2)}),
            r"tensor output.bias must be \[1\] of torch.float32, not \[2\] of torch.float32",
        ),
        (
            lambda t: t.update({"output.bias": torch.zeros(1, dtype=torch.float64)}),
            r"tensor output.bias must be .*, not \[1\] of torch.float64",
        ),
        (
            lambda t: t["output.bias"].fill_(float("nan")),
            "tensor output.bias has numbers that are not finite",
        ),
        (
            lambda t: t["output.weight"][0, 3].fill_(float("-inf")),
            "tensor output.weight has numbers that are not finite",
        ),
    ],
)
def test_weights_of_another_network(policy, change, complaint):
    with_weights(policy, change)
    refused(policy, f"{WEIGHTS}: {complaint}")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=150)
@given(data=st.data())
def test_any_damage_is_refused_or_harmless(policy, data):
    """A byte changed anywhere in the header, the numbers or the config: an error, or a policy."""
    for name in (CONFIG, WEIGHTS):
        sound = (policy / name).read_bytes()
        place = data.draw(st.integers(0, min(len(sound), 3000) - 1))
        damaged = bytearray(sound)
        damaged[place] = data.draw(st.integers(0, 255))
        (policy / name).write_bytes(bytes(damaged))
        with suppress(ValueError):
            network, _ = read_policy(policy)
            assert all(torch.isfinite(weight).all() for weight in network.parameters())
        (policy / name).write_bytes(sound)


# What is not saved, and what saving does not touch.


@pytest.mark.parametrize(
    ("overrides", "complaint"),
    [
        ({"training": {"rate": float("nan")}}, "config must be JSON all through"),
        ({"training": {"seed": np.int64(3)}}, "config must be JSON all through"),
        ({"training": {"log": "x" * 2_000_000}}, "config.json may have up to 1000000 bytes, not 2"),
    ],
)
def test_a_config_that_could_not_be_loaded_is_not_saved(policy, overrides, complaint):
    network = tiny_network(seed=5)
    with pytest.raises(ValueError, match=complaint):
        save_policy(policy, network, tiny_config(network, **overrides))
    assert torch.equal(read_policy(policy)[0].output.weight, tiny_network().output.weight)


def test_weights_that_could_not_be_loaded_are_not_saved(policy):
    for change, complaint in (
        (lambda network: network.output.bias.data.fill_(float("nan")), "not finite"),
        (lambda network: network.double(), "must be .* of torch.float32, not"),
    ):
        network = tiny_network(seed=5)
        change(network)
        with pytest.raises(ValueError, match=complaint):
            save_policy(policy, network, tiny_config(network))
    wide = tiny_network(latent=1024, depth=8)
    with pytest.raises(
        ValueError, match=r"model\.safetensors may have up to 64000000 bytes, not 1"
    ):
        save_policy(policy, wide, tiny_config(wide))
    assert torch.equal(read_policy(policy)[0].output.weight, tiny_network().output.weight)


def test_a_config_of_another_network_is_not_saved(tmp_path):
    network = tiny_network()
    config = tiny_config(network)
    other = replace(config, network=replace(config.network, latent=7))
    with pytest.raises(ValueError, match=r"config describes .*latent=7.*network is .*latent=6"):
        save_policy(tmp_path / "x", network, other)


def test_what_is_no_policy_is_not_replaced(policy):
    (policy / "thesis.tex").write_text("precious")
    with pytest.raises(ValueError, match=r"holds thesis\.tex, which is no policy's; name another"):
        save_tiny(policy)
    assert (policy / "thesis.tex").read_text() == "precious"
    with pytest.raises(ValueError, match="is a file; name another place"):
        save_tiny(policy / CARD)


def test_what_file_browsers_hide_keeps_no_policy_from_its_place(policy):
    (policy / ".DS_Store").touch()
    save_tiny(policy, "reference")
    assert read_policy(policy)[1].features == "reference"


def test_files_may_be_links_as_in_caches_and_symlink_installs(policy, tmp_path):
    (tmp_path / "cache").mkdir()
    for name in (CONFIG, WEIGHTS):
        (policy / name).rename(tmp_path / "cache" / name)
        (policy / name).symlink_to(f"../cache/{name}")
    assert read_policy(policy)[1] == read_policy(tmp_path / "cache")[1]


@pytest.mark.parametrize("kind", ["/dev/zero", "pipe", "nowhere", CONFIG])
def test_links_must_lead_to_files(policy, tmp_path, kind):
    os.mkfifo(tmp_path / "pipe")
    (policy / CONFIG).unlink()
    (policy / CONFIG).symlink_to(kind if kind != "pipe" else tmp_path / "pipe")
    refused(policy, "name a file|no file|in a circle|Too many levels")


def test_loading_needs_no_training_library(policy):
    code = (
        "import sys; from pathlib import Path; from swarm_mj.mission import paper;"
        "from swarm_mj.policies import make_policy;"
        f"make_policy({str(policy)!r}, paper());"
        "sys.exit('stable_baselines3' in sys.modules or 'torch' not in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_torch_is_not_imported_before_a_learned_policy_is_wanted():
    code = (
        "import sys, swarm_mj.policies, swarm_mj.evaluation.study;"
        "from swarm_mj.cli import parse; parse(['evaluate']);"
        "from swarm_mj.mission import paper; from swarm_mj.policies import make_policy;"
        "make_policy('mst', paper()); sys.exit('torch' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.fixture
def one_file(tmp_path):
    """A sound policy in one file."""
    save_tiny(tmp_path / "mine.safetensors")
    return tmp_path / "mine.safetensors"


def test_one_file_is_the_same_policy_as_a_folder(policy, one_file):
    (ours, config), (its, its_config) = read_policy(one_file), read_policy(policy)
    assert config == its_config
    weights = ours.state_dict()
    assert all(torch.equal(weights[name], tensor) for name, tensor in its.state_dict().items())
    digests = [load_policy(path, MISSION).parameters for path in (policy, one_file)]
    assert digests[0] == digests[1]
    assert [path.name for path in one_file.parent.glob("*.safetensors")] == ["mine.safetensors"]


def test_one_file_is_the_same_bytes_every_time_and_has_the_card(one_file, policy):
    before = one_file.read_bytes()
    save_tiny(one_file)
    assert one_file.read_bytes() == before
    with safe_open(one_file, "pt") as opened:
        said = json.loads(opened.metadata()["swarm_mj policy"])
    assert said == {name: (policy / name).read_text() for name in (CONFIG, CARD)}


@pytest.mark.parametrize(
    ("metadata", "complaint"),
    [
        (None, "does not say of which policy"),
        ({"swarm_mj policy": "[]"}, "Expected"),
        ({"swarm_mj policy": "{}"}, "does not say of which policy"),
        ({"swarm_mj policy": '{"config.json": "{}"}'}, "format"),
        ({"format": "pt"}, "does not say of which policy"),
    ],
)
def test_one_file_that_is_no_policy_is_refused(one_file, metadata, complaint):
    save_file(load_file(one_file), one_file, metadata)
    refused(one_file, complaint)


@pytest.mark.parametrize("kept", [0, 4, 8, 100, 5000])
def test_one_file_that_was_cut_off_is_refused(one_file, kept):
    one_file.write_bytes(one_file.read_bytes()[:kept])
    refused(one_file, "mine.safetensors: ")
