"""What is missing is named as pip knows it; which code made a number."""

import re
import shlex
import subprocess
import tomllib
from importlib import metadata
from itertools import chain
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from swarm_mj.system import packages
from swarm_mj.system.packages import BROUGHT_BY, CORE, asset, code_digest, commit, missing, need

ROOT = Path(__file__).parent.parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_what_is_not_there_is_named_with_the_way_to_it():
    need("numpy", "anything")
    with pytest.raises(ModuleNotFoundError) as refused:
        need("no_such_module", "a replay", "fly with record=False")
    assert str(refused.value) == (
        "a replay needs no-such-module, which is not installed; pip install 'no-such-module', or "
        "fly with record=False"
    )
    assert refused.value.name == "no_such_module"


def test_versions_are_those_of_the_package():
    (wanted,) = (each for each in PROJECT["dependencies"] if each.startswith("rerun-sdk"))
    said = missing("rerun", "a replay")
    assert all(bound in said for bound in wanted.replace(">=", ",>=").split(","))


def test_every_package_under_another_name_is_one_of_ours():
    extras = PROJECT["optional-dependencies"].values()
    ours = " ".join([*PROJECT["dependencies"], *chain.from_iterable(extras)])
    assert all(package in ours for package in BROUGHT_BY.values())


def test_without_metadata_the_name_alone_is_told(monkeypatch):
    def unknown(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "requires", unknown)
    assert "pip install 'torch'" in missing("torch", "it")


def test_the_guide_names_the_core_for_those_who_have_a_wheel_only():
    guide = (ROOT / "docs" / "python.md").read_text()
    (line,) = re.findall(r"^pip install (filelock .*)$", guide, re.MULTILINE)
    assert tuple(Requirement(text).name for text in shlex.split(line)) == CORE


def test_assets_are_found_or_named():
    assert asset("arena.xml").is_file()
    assert asset("policies/gnn.safetensors").is_file()
    with pytest.raises(FileNotFoundError, match=r"asset gone\.xml is neither in the package nor"):
        asset("gone.xml")


def test_version_and_commit_are_the_installed_one_and_git_s_own():
    assert packages.version() == metadata.version("swarm_mj")
    command = ["git", "-C", str(ROOT), "rev-parse", "HEAD"]
    head = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    assert head.startswith(str(commit()).rstrip("+"))


def test_outside_a_checkout_the_commit_is_that_of_the_build(package):
    assert commit() is None
    (package / "COMMIT").write_text("0123456789ab+\n")
    assert commit() == "0123456789ab+"
    subprocess.run(["git", "-C", package.parent, "init", "--quiet"], check=True)
    assert commit() is None  # of a repository without a commit; that of the build is another's


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Another checkout's package, in place of this one; no repository yet."""
    folder = tmp_path / "swarm_mj"
    folder.mkdir()
    monkeypatch.setattr(packages, "__file__", str(folder / "system" / "packages.py"))
    return folder


def test_the_digest_tells_code_and_data_apart(package):
    seen = {code_digest()}
    written = [("a.py", "1"), ("a.py", "2"), ("b.csv", ""), ("c.py", ""), ("d.toml", "")]
    for name, content in written:
        (package / name).write_text(content)
        seen.add(code_digest())
    (package / "note.txt").write_text("no code")
    assert code_digest() in seen
    assert len(seen) == 6


def test_only_the_package_makes_a_commit_unclean(package):
    def git(*arguments):
        identity = ("-c", "user.name=n", "-c", "user.email=e@x")
        subprocess.run(["git", "-C", package.parent, *identity, *arguments], check=True)

    assert commit() is None
    (package / "a.py").write_text("1")
    git("init", "--quiet")
    git("add", ".")
    git("commit", "--quiet", "--message", "first")
    clean = commit()
    assert len(str(clean)) == 12
    assets = package.parent / "assets"
    (assets / "figures").mkdir(parents=True)
    (assets / "figures" / "fig4.svg").write_text("drawn from results")
    (package.parent / "results.csv").write_text("mine")
    assert commit() == clean
    for path in (assets / "robot.xml", package / "b.py"):
        path.write_text("new")
        assert commit() == f"{clean}+"
        path.unlink()
