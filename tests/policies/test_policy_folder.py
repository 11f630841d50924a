"""The folder of a stored policy: which it is, what is in it, and what it may replace."""

import numpy as np
import pytest

from swarm_mj.policies.policy_folder import (
    MLP_FORMAT,
    check_replaceable,
    check_tensors,
    is_mlp,
    present_policy,
    read_part,
    write_policy,
)

CONTENTS = {"model.safetensors": b"weights", "config.json": b"{}", "README.md": b"# A card"}


@pytest.fixture
def policy(tmp_path):
    write_policy(tmp_path / "policy", CONTENTS, check=lambda _: None)
    return tmp_path / "policy"


def test_what_is_read_is_what_was_written(policy):
    assert present_policy(policy) == policy
    assert {name: read_part(policy, name) for name in ("model.safetensors", "config.json")} == {
        "model.safetensors": b"weights",
        "config.json": b"{}",
    }
    assert (policy / "README.md").read_bytes() == b"# A card"


def test_what_does_not_pass_its_check_is_not_written(policy):
    def refuses(_):
        raise ValueError("damaged")

    with pytest.raises((ValueError, OSError), match="damaged"):
        write_policy(policy, CONTENTS | {"config.json": b"other"}, check=refuses)
    assert read_part(policy, "config.json") == b"{}"


def test_oversized_parts_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"config\.json"):
        write_policy(
            tmp_path / "x", CONTENTS | {"config.json": b" " * 1_000_001}, check=lambda _: None
        )
    assert not (tmp_path / "x").exists()


def test_a_folder_that_is_something_else(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match="does not exist; name a directory"):
        present_policy(tmp_path / "nowhere")
    with pytest.raises(ValueError, match="is a file; name the directory"):
        present_policy(tmp_path / "file")


def test_a_run_names_the_policy_in_it(tmp_path):
    write_policy(tmp_path / "run" / "policy", CONTENTS, check=lambda _: None)
    with pytest.raises(ValueError, match=r"run is a run; name the policy in it, .*run/policy"):
        present_policy(tmp_path / "run")


@pytest.mark.parametrize(
    ("config", "expected"),
    [
        (f'{{"format": "{MLP_FORMAT}", "format_version": 1}}', True),
        ('{"format": "swarm_mj policy", "format_version": 1}', False),
        ("{}", False),
        ("no JSON", False),
    ],
)
def test_a_config_says_whether_the_network_is_a_plain_one(policy, config, expected):
    (policy / "config.json").write_text(config)
    assert is_mlp(policy) == expected


def test_a_folder_of_policies_lists_them(tmp_path):
    for name in ("a/policy", "b/policy", "sb3"):
        write_policy(tmp_path / name, CONTENTS, check=lambda _: None)
    (tmp_path / "empty").mkdir()
    with pytest.raises(ValueError, match="holds policies; name one of them") as refused:
        present_policy(tmp_path)
    shown = str(refused.value).partition("them: ")[2]
    assert shown == ", ".join(str(tmp_path / name) for name in ("a/policy", "b/policy", "sb3"))
    for n in range(7):
        write_policy(tmp_path / f"c{n}", CONTENTS, check=lambda _: None)
    with pytest.raises(ValueError, match=r"c4, .*c5 and 2 more$"):
        present_policy(tmp_path)
    assert present_policy(tmp_path / "empty") == tmp_path / "empty"


def test_files_that_are_no_policys_are_never_replaced(policy):
    check_replaceable(policy)
    (policy / ".DS_Store").write_text("")
    check_replaceable(policy)
    (policy / "mine.txt").write_text("mine")
    with pytest.raises(ValueError, match=r"holds mine.txt, which is no policy's"):
        check_replaceable(policy)
    with pytest.raises(ValueError, match="is a file; name another place"):
        check_replaceable(policy / "mine.txt")


@pytest.mark.parametrize(
    ("tensors", "complaint"),
    [
        ({}, "it lacks the tensor bias"),
        ({"bias": np.zeros(2), "x": np.zeros(2)}, "it has an unknown tensor x"),
        ({"bias": np.zeros(3)}, r"bias must be \[2\] of float64, not \[3\] of float64"),
        ({"bias": np.zeros(2, dtype=int)}, r"bias must be \[2\] of float64, not \[2\] of int64"),
        ({"bias": np.array([0.0, np.inf])}, "bias has numbers that are not finite"),
    ],
)
def test_tensors_that_are_not_those_expected(tensors, complaint):
    expected = {"bias": "[2] of float64"}
    check_tensors(expected, {"bias": np.ones(2)}, lambda values: np.all(np.isfinite(values)))
    with pytest.raises(ValueError, match=complaint):
        check_tensors(expected, tensors, lambda values: np.all(np.isfinite(values)))
