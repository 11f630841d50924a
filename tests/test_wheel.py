"""The package as built: an index would take it; installed elsewhere, it has assets and flies."""

import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The source distribution, and the wheel that was built from nothing else."""
    dist = tmp_path_factory.mktemp("dist")
    build = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(dist)]
    subprocess.run([*build, str(ROOT)], check=True, capture_output=True)
    return *dist.glob("*.tar.gz"), *dist.glob("*.whl")


@pytest.fixture(scope="module")
def installed(built, tmp_path_factory):
    """A folder with the wheel's contents only."""
    _, wheel = built
    target = tmp_path_factory.mktemp("site")
    install = [sys.executable, "-m", "pip", "install", "--no-deps", "--target", str(target)]
    subprocess.run([*install, str(wheel)], check=True, capture_output=True)
    return target


def run(installed, tmp_path, *arguments):
    """Runs Python away from the checkout, the wheel's contents first on its path."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(installed)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_an_index_would_take_both(built):
    check = [sys.executable, "-m", "twine", "check", "--strict", *map(str, built)]
    done = subprocess.run(check, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert done.stdout.count("PASSED") == 2


def test_both_bring_what_they_need(built):
    source, wheel = built
    with tarfile.open(source) as archive:
        sources = {name.partition("/")[2] for name in archive.getnames()}
    assert {"LICENSE", "README.md", "CITATION.cff", "tests/conftest.py", "docs/code.md"} <= sources
    with zipfile.ZipFile(wheel) as archive:
        names = {name.removeprefix("swarm_mj/") for name in archive.namelist()}
    assets = {f"assets/{name}" for name in ("arena.xml", "robot.xml", "policies/gnn/config.json")}
    assert {"py.typed", "policies/tuned.csv", "evaluation/published.csv"} | assets <= names
    assert not any(name.startswith(("tests/", "tools/", "training/")) for name in names)


def test_assets_come_from_the_wheel(installed, tmp_path):
    done = run(
        installed,
        tmp_path,
        "-c",
        "from swarm_mj.io.assets import asset; print(asset('arena.xml'))",
    )
    assert done.stdout.strip() == str(installed / "swarm_mj" / "assets" / "arena.xml")


def test_it_flies_the_shipped_network_and_leaves_a_replay(installed, tmp_path):
    command = ("fly", "--policy", "gnn", "--robots", "5", "--windows", "10")
    done = run(installed, tmp_path, "-m", "swarm_mj", *command)
    assert done.returncode == 0, done.stderr
    assert len(list((tmp_path / "replays").glob("*.rrd"))) == 1
