"""What is built has the commit of what it was built from."""

import shutil
import subprocess
from pathlib import Path

import pytest
from store_commit import STORED, StoreCommit

ROOT = Path(__file__).parents[2]


@pytest.fixture
def checkout(tmp_path):
    """A folder with the one module that knows the commit; no repository yet."""
    system = tmp_path / "swarm_mj" / "system"
    system.mkdir(parents=True)
    shutil.copy(ROOT / "swarm_mj" / "system" / "packages.py", system)
    return tmp_path


def git(folder, *arguments):
    identity = ("-c", "user.name=n", "-c", "user.email=e@x")
    command = ["git", "-C", str(folder), *identity, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def stored(folder, version="standard"):
    """What a build there adds to the archive, as text, by the places."""
    hook = StoreCommit(str(folder), {}, None, None, str(folder / "dist"), "wheel")
    build_data = {"force_include": {}}
    hook.initialize(version, build_data)
    files = build_data["force_include"]
    texts = {place: Path(file).read_text() for file, place in files.items()}
    hook.finalize(version, build_data, "")
    assert not any(Path(file).exists() for file in files)
    return texts


def test_a_build_stores_the_commit_and_whether_files_had_changed(checkout):
    git(checkout, "init", "--quiet")
    git(checkout, "add", ".")
    git(checkout, "commit", "--quiet", "--message", "first")
    head = git(checkout, "rev-parse", "--short=12", "HEAD")
    assert stored(checkout) == {STORED: f"{head}\n"}
    assert stored(checkout, "editable") == {}
    (checkout / "swarm_mj" / "more.py").touch()
    assert stored(checkout) == {STORED: f"{head}+\n"}


def test_without_a_repository_a_stored_commit_stays_and_none_is_made_up(checkout):
    assert stored(checkout) == {}
    (checkout / STORED).write_text("0123456789ab\n")
    assert stored(checkout) == {}
    assert (checkout / STORED).read_text() == "0123456789ab\n"
