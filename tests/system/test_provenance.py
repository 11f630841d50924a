"""Which code made a number."""

import subprocess
from importlib import metadata
from pathlib import Path

from swarm_mj.system import provenance


def test_the_version_is_the_installed_one():
    assert provenance.version() == metadata.version("swarm_mj")


def test_the_commit_is_git_s_own():
    root = Path(provenance.__file__).parents[2]
    command = ["git", "-C", str(root), "rev-parse", "HEAD"]
    head = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    assert head.startswith(provenance.commit().rstrip("+"))


def test_outside_a_checkout_there_is_no_commit(tmp_path, monkeypatch):
    monkeypatch.setattr(provenance, "__file__", str(tmp_path / "swarm_mj" / "io" / "provenance.py"))
    assert provenance.commit() is None


def test_the_digest_tells_code_and_data_apart(tmp_path, monkeypatch):
    package = tmp_path / "swarm_mj"
    package.mkdir()
    monkeypatch.setattr(provenance, "__file__", str(package / "io" / "provenance.py"))
    seen = {provenance.code_digest()}
    for name, content in [("a.py", "1"), ("a.py", "2"), ("b.csv", ""), ("c.py", "")]:
        (package / name).write_text(content)
        assert provenance.code_digest() == provenance.code_digest()
        seen.add(provenance.code_digest())
    (package / "note.txt").write_text("no code")
    assert provenance.code_digest() in seen
    assert len(seen) == 5


def test_only_the_package_makes_a_commit_unclean(tmp_path, monkeypatch):
    def git(*arguments):
        identity = ("-c", "user.name=n", "-c", "user.email=e@x")
        subprocess.run(["git", "-C", tmp_path, *identity, *arguments], check=True)

    package = tmp_path / "swarm_mj"
    package.mkdir()
    (package / "a.py").write_text("1")
    git("init", "--quiet")
    git("add", ".")
    git("commit", "--quiet", "--message", "first")
    monkeypatch.setattr(provenance, "__file__", str(package / "io" / "provenance.py"))
    clean = provenance.commit()
    assert len(clean) == 12
    (tmp_path / "results.csv").write_text("mine")
    (tmp_path / "assets" / "figures").mkdir(parents=True)
    (tmp_path / "assets" / "figures" / "fig4.svg").write_text("drawn from results")
    assert provenance.commit() == clean
    (tmp_path / "assets" / "robot.xml").write_text("new")
    assert provenance.commit() == f"{clean}+"
    (tmp_path / "assets" / "robot.xml").unlink()
    (package / "b.py").write_text("new")
    assert provenance.commit() == f"{clean}+"
