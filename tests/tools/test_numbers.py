"""The numbers of the README and the docs are those of the results, all of one commit."""

import csv
import re
from pathlib import Path
from shutil import copy, copytree

import pytest
from results import OTHERS, STUDIES
from results_table import MARKER, PAGES, main, numbers

from swarm_mj.system.exit_codes import DONE

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "training" / "results"
CODE = re.compile(r"^( *)```.*?^\1```$", re.MULTILINE | re.DOTALL)
BY_HAND = re.compile(r"±|\bcommit `?[0-9a-f]{7,}")
# What chose the constants of a policy, and what was tried at the released program, not flown.
APART = {RESULTS / "classics-tuning.csv", RESULTS / "attack.csv"}


def test_the_pages_have_the_numbers_of_the_results():
    assert not [page.name for page in numbers(PAGES, RESULTS)]


def by_hand(text):
    """The errors and commits that no tool has written."""
    return BY_HAND.findall(MARKER.sub("", CODE.sub("", text)))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_page_has_results_that_were_typed(page):
    assert not by_hand(page.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("12.0 ± 0.5 windows", ["±"]),
        ("at commit e15dd29, and commit `e15dd29`", ["commit e15dd29", "commit `e15dd29"]),
        ("commit early\n", []),
        ("<!-- table: x -->\n\n| 1 ± 2 |\n\n*commit e15dd29*\n\n<!-- end -->\n", []),
        ("of <!-- value: x {a} -->1 ± 2<!-- end --> windows, 3 ± 4", ["±"]),
        ("```\n1 ± 2\n```\ntext\n  ```sh\n3 ± 4\n  ```\n", []),
        ("```\n1\n```\n2 ± 3\n```\n4\n```\n", ["±"]),
    ],
)
def test_errors_and_commits_count_outside_markers_and_code_only(text, found):
    assert by_hand(text) == found


def commits_of(paths):
    """The files of each commit."""
    commits = {}
    for path in paths:
        with path.open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                commits.setdefault(row["commit"], set()).add(path.name)
    return commits


def test_all_flights_and_timings_are_of_one_clean_commit():
    for paths in ({*RESULTS.rglob("*.csv")} - APART, *({each} for each in APART)):
        commits = commits_of(paths)
        assert len(commits) == 1, commits
        assert re.fullmatch("[0-9a-f]{12}", *commits)


def test_the_tables_can_be_made_from_what_make_results_makes(tmp_path):
    beside = ("exact", "converging-late")  # `floor` makes the first, `converging-courses` the other
    for name in (*STUDIES, *OTHERS, *beside):  # `gnn` has a folder
        if name != "gnn":
            copy(RESULTS / f"{name}.csv", tmp_path)
    for name in STUDIES:
        copy(RESULTS / f"{name}.parquet", tmp_path)
    copytree(RESULTS / "reproduce", tmp_path / "reproduce")
    assert main(["--structure", "--results", str(tmp_path)]) == DONE
