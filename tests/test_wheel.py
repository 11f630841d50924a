"""The package as a wheel, installed elsewhere: it brings its assets along, and flies."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder with the wheel's contents only."""
    dist, target = tmp_path_factory.mktemp("dist"), tmp_path_factory.mktemp("site")
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(dist)]
    subprocess.run([*build, str(ROOT)], check=True, capture_output=True)
    (wheel,) = dist.glob("*.whl")
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
