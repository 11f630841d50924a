"""What is missing is named as pip knows it, with the versions that fit."""

import re
import shlex
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from swarm_mj.system import packages
from swarm_mj.system.packages import BROUGHT_BY, CORE, asset, missing, need

ROOT = Path(__file__).parent.parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_what_is_there_passes():
    need("numpy", "anything")


def test_what_is_not_is_named_with_the_way_to_it():
    with pytest.raises(ModuleNotFoundError) as refused:
        need("no_such_module", "a replay", "fly with record=False")
    assert str(refused.value) == (
        "a replay needs no-such-module, which is not installed; pip install 'no-such-module', or "
        "fly with record=False"
    )
    assert refused.value.name == "no_such_module"


def test_versions_are_those_of_the_package():
    (wanted,) = (each for each in PROJECT["dependencies"] if each.startswith("rerun-sdk"))
    name, *bounds = wanted.replace(">=", " >=").split()
    said = missing("rerun", "a replay")
    assert name in said
    for bound in ",".join(bounds).split(","):
        assert bound in said


def test_every_package_under_another_name_is_one_of_ours():
    ours = " ".join(PROJECT["dependencies"])
    assert all(package in ours for package in BROUGHT_BY.values())


def test_without_metadata_the_name_alone_is_told(monkeypatch):
    def unknown(name):
        raise packages.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(packages.metadata, "requires", unknown)
    assert "pip install 'torch'" in missing("torch", "it")


def test_the_guide_names_the_core_for_those_who_have_a_wheel_only():
    guide = (ROOT / "docs" / "python.md").read_text()
    (line,) = re.findall(r"^pip install (jaxtyping .*)$", guide, re.MULTILINE)
    named = [Requirement(text) for text in shlex.split(line)]
    assert tuple(each.name for each in named) == CORE


def test_files_and_folders_are_found():
    assert asset("arena.xml").is_file()
    assert asset("policies/gnn.safetensors").is_file()


def test_what_is_missing_is_named():
    with pytest.raises(FileNotFoundError, match=r"asset gone\.xml is neither in the package nor"):
        asset("gone.xml")
