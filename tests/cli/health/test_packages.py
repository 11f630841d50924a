"""Packages that are there, missing, too old; by what an installation would ask for."""

import tomllib
from email.message import Message
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from swarm_mj.cli.health import packages as looked_at
from swarm_mj.cli.health.packages import EXTRAS, PURPOSES, about, packages
from swarm_mj.system.packages import CORE

PROJECT = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]
INSTALLED = {"numba": "0.68.1", "mujoco": "3.2", "torch": "2.7", "pettingzoo": "1.27"}
ASKED = [
    "numba>=0.68",
    "mujoco>=3.17,<4",
    "numpy>=2.2",
    "torch>=2.7",
    "av>=14",
    'pettingzoo>=1.25; extra == "pettingzoo"',
    'ruff>=0.17; extra == "dev"',
    'swarm_mj[pettingzoo]; extra == "dev"',
]


@pytest.fixture
def found(monkeypatch):
    """What is found of an installation that asks for much and has little."""

    def version(name):
        if name not in INSTALLED:
            raise metadata.PackageNotFoundError(name)
        return INSTALLED[name]

    extras = Message()
    for extra in ("pettingzoo", "dev"):
        extras["Provides-Extra"] = extra
    monkeypatch.setattr(looked_at.metadata, "version", version)
    monkeypatch.setattr(looked_at.metadata, "requires", lambda _: ASKED)
    monkeypatch.setattr(looked_at.metadata, "metadata", lambda _: extras)
    return {each.name: each for each in packages()}


@pytest.mark.parametrize(
    ("name", "state", "words", "mend"),
    [
        ("numba", "ok", "0.68.1", ""),
        ("mujoco", "broken", "3.2, which is not <4,>=3.17; for flying", "'mujoco<4,>=3.17'"),
        ("numpy", "broken", "not installed; for flying", "pip install 'numpy>=2.2'"),
        ("torch", "ok", "2.7", ""),
        ("av", "absent", "not installed; for videos of replays", "pip install 'av>=14'"),
        ("extra pettingzoo", "ok", "installed; for PettingZoo environments", ""),
        ("extra dev", "absent", "lacks ruff; for tests", "pip install 'swarm_mj[dev]'"),
    ],
)
def test_each_is_as_it_is_installed(found, name, state, words, mend):
    assert found[name].state == state
    assert words in found[name].found
    assert mend in found[name].mend


def test_every_dependency_is_needed_or_has_a_purpose():
    asked = {Requirement(text).name for text in PROJECT["dependencies"]}
    assert asked == set(CORE) | set(PURPOSES)
    assert set(PROJECT["optional-dependencies"]) == set(EXTRAS)


def test_it_says_which_version_this_is():
    assert {each.name: each for each in about()}["version"].found.startswith(PROJECT["version"])
