"""The package as built: an index would take it; installed elsewhere, it has assets and flies."""

import json
import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from swarm_mj.system.packages import CORE, commit

pytestmark = pytest.mark.slow
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


def run(folder, path, *arguments):
    """Runs Python away from the checkout, with these folders first on its path."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, path))}
    environment.pop("MUJOCO_GL", None)  # MuJoCo then loads OpenGL
    command = [sys.executable, *arguments]
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def test_an_index_would_take_both(built):
    check = [sys.executable, "-m", "twine", "check", "--strict", *map(str, built)]
    done = subprocess.run(check, capture_output=True, text=True, check=True)
    assert done.stdout.count("PASSED") == 2


def test_both_bring_what_they_need(built):
    source, wheel = built
    with tarfile.open(source) as archive:
        sources = {name.partition("/")[2] for name in archive.getnames()}
    assert {"LICENSE", "README.md", "CITATION.cff", "tests/conftest.py", "docs/code.md"} <= sources
    with zipfile.ZipFile(wheel) as archive:
        names = {name.removeprefix("swarm_mj/") for name in archive.namelist()}
    assets = {f"assets/{name}" for name in ("arena.xml", "robot.xml", "policies/gnn.safetensors")}
    assert {"py.typed", "policies/tuned.csv", "evaluation/published.csv"} | assets <= names
    assert not any(name.startswith(("tests/", "tools/", "training/")) for name in names)


def test_assets_come_from_the_wheel(installed, tmp_path):
    code = "from swarm_mj.system.packages import asset; print(asset('arena.xml'))"
    done = run(tmp_path, [installed], "-c", code)
    assert done.stdout.strip() == str(installed / "swarm_mj" / "assets" / "arena.xml")


def test_the_commit_is_that_of_the_checkout_that_was_built(installed, tmp_path):
    code = "from swarm_mj.system.packages import commit; print(commit())"
    done = run(tmp_path, [installed], "-c", code)
    assert done.stdout.strip().rstrip("+") == str(commit()).rstrip("+")
    assert commit() is not None


def test_it_flies_the_shipped_network_and_leaves_a_replay(installed, tmp_path):
    command = ("fly", "--policy", "gnn", "--robots", "5", "--windows", "10")
    done = run(tmp_path, [installed], "-m", "swarm_mj", *command)
    assert done.returncode == 0, done.stderr
    assert len(list((tmp_path / "replays").glob("*.rrd"))) == 1


def test_the_core_is_a_part_of_all_with_the_same_versions():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    core = project["dependency-groups"]["core"]
    assert set(core) <= set(project["project"]["dependencies"])
    assert tuple(Requirement(each).name for each in core) == CORE


def with_what_they_need(names, extras=("",)):
    """Packages and all that they bring along, as pip would install them."""
    for name in names:
        yield name
        for each in map(Requirement, metadata.requires(name) or ()):
            if each.marker is None or any(each.marker.evaluate({"extra": e}) for e in extras):
                yield from with_what_they_need([each.name], ("", *each.extras))


@pytest.fixture(scope="module")
def core(installed, tmp_path_factory):
    """Runs Python where nothing is installed but the wheel, the core and what that needs."""
    packages, wheel = tmp_path_factory.mktemp("core"), tmp_path_factory.mktemp("wheel")
    for name in set(with_what_they_need(CORE)):
        for top in {file.parts[0] for file in metadata.files(name)} - {"..", "__pycache__"}:
            (packages / top).symlink_to(metadata.distribution(name).locate_file(top))
    shutil.copytree(installed, wheel, dirs_exist_ok=True)
    # Compiled code of the same sources: to compile takes long.
    for compiled in (ROOT / "swarm_mj").rglob("*.nb?"):
        place = wheel / compiled.relative_to(ROOT)
        place.parent.mkdir(exist_ok=True)
        shutil.copy(compiled, place)
    # -S: without this Python's own site-packages.
    return lambda folder, *arguments: run(folder, [wheel, packages], "-S", *arguments)


FLY_IN_THE_CORE = """
import json, sys
import swarm_mj
run = swarm_mj.fly(record=False)
urban = swarm_mj.fly(preset="urban", num_robots=10, num_windows=50, record=False)
swarm_mj.evaluate("tdma", preset="urban", num_robots=10, num_windows=50, num_missions=2)
told = []
for work in (run.to_dataframe, run.plot, lambda: swarm_mj.fly(policy="gnn")):
    try:
        work()
    except ModuleNotFoundError as error:
        told.append(str(error))
names = {name.partition(".")[0] for name in sys.modules} - set(sys.stdlib_module_names)
windows = run.summary.num_windows + urban.summary.num_windows
print(json.dumps([windows, told, sorted(names)]))
"""


def test_the_core_flies_the_default_and_says_what_it_lacks(core, tmp_path):
    done = core(tmp_path, "-c", FLY_IN_THE_CORE)
    assert done.returncode == 0, done.stderr
    num_windows, told, modules = json.loads(done.stdout)
    assert num_windows == 550
    for package, complaint in zip(("pandas", "matplotlib", "torch"), told, strict=True):
        assert f"needs {package}, which is not installed; pip install '{package}>=" in complaint
    brought_along = {"cython_runtime", "glfw", "llvmlite", "swarm_mj", "typing_extensions"}
    public = {name for name in modules if not name.startswith("_")}
    assert public <= {*CORE, *brought_along}


def test_the_core_flies_on_the_command_line_but_records_nothing(core, tmp_path):
    refused = core(tmp_path, "-m", "swarm_mj", "fly", "--record", "a.rrd")
    assert refused.returncode == 1
    assert "a replay needs rerun-sdk, which is not installed; pip install 'rerun" in refused.stderr
    assert refused.stderr.endswith("or fly without one: --no-record\n")
    assert list(tmp_path.iterdir()) == []
    done = core(tmp_path, "-m", "swarm_mj", "fly")
    assert done.returncode == 0, done.stderr
    assert done.stderr.startswith(
        "no replay is recorded: it needs rerun-sdk, which is not installed"
    )
    assert "flocking, planner, 40 robots, seed 1" in done.stdout
    lacking = core(tmp_path, "-m", "swarm_mj", "replay", "a.rrd")
    assert lacking.returncode == 1
    assert lacking.stderr.count("\n") == 1
    assert "is not installed; pip install" in lacking.stderr
