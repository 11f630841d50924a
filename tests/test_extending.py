"""The ten changes of docs/extending.md apply to the tree, and their tests pass with them."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/extending.md").read_text("utf-8")
GOALS = {
    "A policy with a payload": 2,
    "A mission field with an option": 1,
    "A path loss": 2,
    "A task with a cost": 3,
    "A replay layer": 3,
    "An arena": 1,
    "A column of evaluate's table": 2,
    "An observation feature": 1,
    "A method's look in figures": 1,
    "The PPO clip": 1,
}
# What each change shows, besides its tests: a program of Python, and a part of what it prints.
FLY = "--robots 5 --windows 5 --no-record"
COMMAND = "from swarm_mj.cli import main; raise SystemExit(main({!r}.split()))"
SHOWS = {
    "A policy with a payload": (
        COMMAND.format("policies fresher-first --json"),
        '"payload": "age"',
    ),
    "A mission field with an option": (COMMAND.format("fly --help-all"), "--failure-at"),
    "A path loss": (
        COMMAND.format(f"fly --path-loss cluttered --clutter-m 240 {FLY}"),
        "path_loss cluttered",
    ),
    "A task with a cost": (COMMAND.format(f"fly --task gathering {FLY}"), "spread of the team"),
    "A replay layer": (
        "from swarm_mj.replay import layers; print(layers.CENTRE.path)",
        "arena/centre",
    ),
    "An arena": (COMMAND.format(f"fly --arena orchard {FLY}"), "orchard"),
    "A column of evaluate's table": (
        "from swarm_mj.evaluation.results import COLUMNS; print(COLUMNS)",
        "hops_worst",
    ),
    "An observation feature": (
        "from swarm_mj.policies.gnn.feature_sets import load_features, known_names\n"
        "own = 'swarm_mj.policies.gnn.extended_features:SpeedFeatures'\n"
        "load_features(own)\n"
        "print(known_names(own))",
        "'size of the team', 'speed')",
    ),
    "A method's look in figures": (
        "from swarm_mj.evaluation.figures.style import look_of; print(look_of('tdma'))",
        "one after the other",
    ),
    "The PPO clip": (COMMAND.format("train --help-all"), "--clip"),
}


class Change(NamedTuple):
    """A section of the page."""

    title: str
    files: list[str]  # that it says it touches
    diff: str
    tests: list[str]  # the command's arguments


def changes():
    """The sections of the page, in its order."""
    for section in re.split(r"^## \d+\. ", PAGE, flags=re.MULTILINE)[1:]:
        (command,) = re.findall(r"^```sh\n(.*?)^```$", section, re.MULTILINE | re.DOTALL)
        program, *arguments = shlex.split(command)
        assert (program, arguments[:2]) == (".venv/bin/python", ["-m", "pytest"])
        yield Change(
            title=section.partition("\n")[0],
            files=re.findall(r"^- `(.+)`$", section, re.MULTILINE),
            diff="".join(re.findall(r"^```diff\n(.*?)^```$", section, re.MULTILINE | re.DOTALL)),
            tests=arguments,
        )


CHANGES = {change.title: change for change in changes()}


def apply(change, folder):
    """Apply a change to the files in a folder, which need be no repository."""
    # Without a repository above it, git takes the folder's files as they are.
    alone = os.environ | {"GIT_CEILING_DIRECTORIES": str(folder.parent)}
    done = subprocess.run(
        ["git", "apply", "--whitespace=error-all", "-"],
        cwd=folder,
        env=alone,
        input=change.diff,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{change.title}: {done.stderr}"


def test_there_are_ten_changes_with_tests():
    assert list(CHANGES) == list(GOALS) == list(SHOWS)
    for change in CHANGES.values():
        named = [each for each in change.tests if each.startswith("tests/")]
        assert named, change.title
        assert all((ROOT / each).is_file() or each in change.files for each in named), change.title


def test_each_change_applies_and_touches_no_more_files_than_it_says(tmp_path):
    for number, change in enumerate(CHANGES.values()):
        assert len(change.files) <= GOALS[change.title], change.title
        touched = re.findall(r"^\+\+\+ b/(\S+)$", change.diff, re.MULTILINE)
        assert sorted(touched) == sorted(change.files), change.title
        folder = tmp_path / str(number)
        before = {}
        for name in change.files:
            if (ROOT / name).exists():
                before[name] = (ROOT / name).read_text("utf-8")
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                (folder / name).write_text(before[name], "utf-8")
        folder.mkdir(exist_ok=True)
        apply(change, folder)
        for name in change.files:
            assert (folder / name).read_text("utf-8") != before.get(name), name


def link(source, target):
    """Link a file if the disk can, so that a copy of the tree takes no time and no space."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


@pytest.fixture
def tree(tmp_path):
    """A copy of the tree with what numba has compiled; its files may be replaced, not changed."""
    # Python and numba replace what they have compiled, too.
    left_out = shutil.ignore_patterns(".*", "site", "runs", "replays", "build", "dist")
    folder = tmp_path / "tree"
    shutil.copytree(ROOT, folder, ignore=left_out, copy_function=link)
    return folder


# A test beside those of the page, in the process that has loaded and compiled the changed package.
SHOWN = """
from contextlib import suppress


def test_it_shows(capsys):
    with suppress(SystemExit):
        exec({program!r}, {{}})
    assert {said!r} in capsys.readouterr().out
"""
# Tests that fly all policies, which are compiled anew for most of a minute.
LEFT_OUT = {"A mission field with an option": "every_policy"}


def run_tests(folder, *arguments):
    """Run tests in the copy, whose package comes before the one that is installed."""
    environment = os.environ | {"PYTHONPATH": str(folder), "COLUMNS": "200"}
    environment.pop("PYTEST_ADDOPTS", None)
    return subprocess.run(
        [sys.executable, "-m", "pytest", *arguments, "-q", "-p", "no:cacheprovider"],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow  # the changed files are compiled anew: up to half a minute each
@pytest.mark.parametrize("title", CHANGES)
def test_the_tests_that_hold_a_change_pass_with_it_and_it_shows(title, tree, forks):
    change = CHANGES[title]
    program, said = SHOWS[title]
    before = tree.parent / "before.py"
    before.write_text(program, "utf-8")
    assert said not in forks.run(tree.parent, before).stdout
    for name in change.files:  # links of the tree's own files
        if (tree / name).exists():
            text = (tree / name).read_text("utf-8")
            (tree / name).unlink()
            (tree / name).write_text(text, "utf-8")
    apply(change, tree)
    shown = tree / "tests/test_shown.py"
    shown.write_text(SHOWN.format(program=program, said=said), "utf-8")
    left_out = LEFT_OUT.get(title)
    chosen = ["-k", f"not {left_out}"] if left_out else []
    _, _, *tests = change.tests  # but for `-m pytest`
    done = run_tests(tree, *tests, "tests/test_shown.py", "-m", "not slow", *chosen)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
