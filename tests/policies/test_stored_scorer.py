"""Learned scorers on disk: as they were saved, and refused with a way out where they are not."""

import json

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file
from standing_teams import flooded_team
from tiny_policies import save_tiny

from swarm_mj.mission import paper
from swarm_mj.policies import Planner, is_learned, make_policy
from swarm_mj.policies.schedule import links_between
from swarm_mj.policies.stored_scorer import is_scorer, load_scorer, save_scorer
from swarm_mj.policies.worth_network import WorthNetwork, num_weights, unpacked
from swarm_mj.swarm import Swarm

MISSION = paper("stationary", num_robots=6)
CONFIG, WEIGHTS, CARD = "config.json", "model.safetensors", "README.md"
LIMIT = 1_000_000  # bytes of a file
WAY_OUT = "; copy it again, or make one with training/plan_network.py"


def weights(seed=0):
    return unpacked(0.5 * np.random.default_rng(seed).standard_normal(num_weights()))


def save(folder, seed=0):
    save_scorer(folder, weights(seed), {"seed": seed}, "# Mine\n")
    return folder


@pytest.fixture
def folder(tmp_path):
    """A sound scorer's folder."""
    return save(tmp_path / "policy")


def refused(folder, complaint):
    """With the name as it was given, and a way out; the complaint itself may be another's."""
    with pytest.raises(ValueError, match=complaint) as error:
        load_scorer(folder)
    assert str(error.value).startswith(f"policy {folder}: ")
    assert str(error.value).endswith(WAY_OUT)
    assert "\n" not in str(error.value)


def test_a_loaded_scorer_says_the_same(folder):
    team = flooded_team(MISSION, 2)
    links = links_between(team.radio, team.position_m, np.full(6, 9.0))
    expected = WorthNetwork(weights(), digest="")(links)
    for array, again in zip(expected, load_scorer(folder)(links), strict=True):
        np.testing.assert_array_equal(array, again)


def test_a_scorer_is_three_files_that_others_can_read(folder):
    assert sorted(path.name for path in folder.iterdir()) == [CARD, CONFIG, WEIGHTS]
    stored = load_file(folder / WEIGHTS)
    assert stored.keys() == weights().keys()
    assert all(np.array_equal(stored[name], array) for name, array in weights().items())
    assert json.loads((folder / CONFIG).read_text()) == {
        "format": "swarm_mj plan network",
        "format_version": 1,
        "training": {"seed": 0},
    }
    assert (folder / CARD).read_text() == "# Mine\n"


def test_the_digest_is_that_of_the_weights_alone(tmp_path):
    scorers = [save(tmp_path / str(n), seed) for n, seed in enumerate((0, 0, 1))]
    (scorers[1] / CARD).write_text("# Another's\n")
    first, same, other = (load_scorer(path).parameters["digest"] for path in scorers)
    assert len(first) == 12
    assert first == same != other


def test_saving_again_replaces_the_scorer(folder):
    before = load_scorer(folder).parameters
    save(folder, seed=1)
    assert load_scorer(folder).parameters != before
    assert [path.name for path in folder.parent.iterdir()] == [folder.name]


def test_a_scorer_left_aside_by_a_kill_is_loaded(folder):
    folder.rename(folder.with_name(".policy.old"))
    assert is_scorer(folder)
    load_scorer(folder)


def test_what_would_not_load_is_not_saved(folder):
    before = load_scorer(folder).parameters
    broken = weights(1)
    broken["share"][2] = np.nan
    with pytest.raises(ValueError, match="tensor share has numbers that are not finite"):
        save_scorer(folder, broken, {}, "")
    with pytest.raises(ValueError, match="not JSON compliant"):
        save_scorer(folder, weights(1), {"held_out": float("nan")}, "")
    assert load_scorer(folder).parameters == before
    assert [path.name for path in folder.parent.iterdir()] == [folder.name]


# In the place of a policy's name.


def test_the_planner_flies_by_a_scorer_in_a_folder(folder):
    assert is_learned(str(folder))
    policy = make_policy(str(folder), MISSION)
    assert isinstance(policy, Planner)
    assert policy.parameters == load_scorer(folder).parameters
    swarm = Swarm(MISSION, [1])
    for _ in range(20):
        swarm.step(policy)
    assert np.all(swarm.buffers.is_known)


def test_a_scorer_has_no_probability(folder):
    with pytest.raises(ValueError, match="takes no transmission probability; leave out"):
        make_policy(str(folder), MISSION, 0.1)


def test_the_refusal_reaches_who_named_the_folder(folder):
    (folder / WEIGHTS).unlink()
    with pytest.raises(ValueError, match=r"there is no model.safetensors; copy it again"):
        make_policy(str(folder), MISSION)


def test_other_policies_are_no_scorers(tmp_path, folder):
    save_tiny(tmp_path / "tiny")
    assert not is_scorer(tmp_path / "tiny")
    assert not is_scorer(tmp_path / "nowhere")
    assert not isinstance(make_policy(str(tmp_path / "tiny"), MISSION), Planner)
    assert is_scorer(folder)


# What is no scorer.


def test_no_directory(tmp_path):
    refused(tmp_path / "x", "there is no config.json")


@pytest.mark.parametrize("name", [CONFIG, WEIGHTS])
def test_a_missing_file(folder, name):
    (folder / name).unlink()
    refused(folder, f"there is no {name}")


@pytest.mark.parametrize(("name", "size"), [(CONFIG, LIMIT + 1), (WEIGHTS, 10**13)])
def test_an_oversized_file(folder, name, size):
    """Sparse: it would take long to read, and is not read."""
    with (folder / name).open("r+b") as file:
        file.truncate(size)
    refused(folder, f"{name} may have up to {LIMIT} bytes")


def test_a_file_of_the_largest_size_is_read(folder):
    text = (folder / CONFIG).read_text()
    (folder / CONFIG).write_text(text + " " * (LIMIT - len(text)))
    assert is_scorer(folder)
    load_scorer(folder)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '"format_version"'])
def test_what_is_no_config(folder, text):
    (folder / CONFIG).write_text(text)
    refused(folder, None)
    assert not is_scorer(folder)


@pytest.mark.parametrize("version", [2, None, "1", [1]])
def test_another_version(folder, version):
    """It says that it is a scorer, so the refusal is the scorers'."""
    config = {"format": "swarm_mj plan network", "format_version": version}
    (folder / CONFIG).write_text(json.dumps(config))
    assert is_scorer(folder)
    with pytest.raises(ValueError, match="its format_version must be 1, not"):
        make_policy(str(folder), MISSION)
    refused(folder, "its format_version must be 1, not")


def test_another_format(folder):
    (folder / CONFIG).write_text('{"format": "another", "format_version": 1}')
    assert not is_scorer(folder)
    refused(folder, "its format must be")


def test_a_config_nested_too_deep(folder):
    (folder / CONFIG).write_text("[" * 100_000)
    assert not is_scorer(folder)
    refused(folder, None)


# What are no weights.


@pytest.mark.parametrize("share", [0.0, 0.001, 0.1, 0.5, 0.999])
def test_truncated_weights(folder, share):
    data = (folder / WEIGHTS).read_bytes()
    (folder / WEIGHTS).write_bytes(data[: int(share * len(data))])
    refused(folder, "Error while deserializing")


@pytest.mark.parametrize("data", [b"PK\x03\x04 a pickle of torch's", b"\0" * 64])
def test_weights_of_another_format(folder, data):
    (folder / WEIGHTS).write_bytes(data)
    refused(folder, "Error while deserializing")


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda t: t.pop("pair_bias"), "it lacks the tensor pair_bias"),
        (lambda t: t.update(wings=np.zeros(2, np.float32)), "it has an unknown tensor wings"),
        (lambda t: t.update(share=t["share"][:5]), r"share must be \(6, 1\), not \(5, 1\)"),
        (lambda t: t["own"].fill(np.inf), "tensor own has numbers that are not finite"),
    ],
)
def test_weights_of_another_network(folder, change, complaint):
    tensors = load_file(folder / WEIGHTS)
    change(tensors)
    save_file(tensors, folder / WEIGHTS)
    refused(folder, complaint)


def test_weights_of_another_type(folder):
    tensors = load_file(folder / WEIGHTS)
    save_file({name: array.astype(np.int64) for name, array in tensors.items()}, folder / WEIGHTS)
    refused(folder, "must be of float32, not int64")
