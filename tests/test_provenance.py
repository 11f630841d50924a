"""Which code made a number."""

import subprocess
from importlib import metadata
from pathlib import Path

from swarm_mj import provenance


def test_the_version_is_the_installed_one():
    assert provenance.version() == metadata.version("swarm_mj")


def test_the_commit_is_git_s_own():
    root = Path(provenance.__file__).parent.parent
    command = ["git", "-C", str(root), "rev-parse", "HEAD"]
    head = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    assert head.startswith(provenance.commit().rstrip("+"))


def test_outside_a_checkout_there_is_no_commit(tmp_path, monkeypatch):
    monkeypatch.setattr(provenance, "__file__", str(tmp_path / "swarm_mj" / "provenance.py"))
    assert provenance.commit() is None
