"""Rows of result files by what they say, for the tables of the docs."""

import csv
import json
import math
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from swarm_mj.evaluation.published import RESULT_FIGURES, points

Row = dict[str, Any]
Rows = list[Row]
PAPER = "published"  # in place of a file: the paper's own points
MISSIONS = ("episodes", "seed")
# `make results` does not fly these: docs/results.md says how they are made.
NOT_FLOWN = ("peers", "attack")
COMMITTED = Path(__file__).resolve().parent.parent / "training" / "results"


def read(names: Iterable[str], folder: Path) -> Rows:
    """Return the rows of results by their names, `published` among them."""
    return [row for name in names for row in _rows(name, folder)]


@cache
def _rows(name: str, folder: Path) -> Rows:
    if name == PAPER:
        return _published()
    folder = COMMITTED if name in NOT_FLOWN else folder  # a smoke test has none of its own
    with (folder / f"{name}.csv").open(newline="", encoding="utf-8") as file:
        return [_row(name, row) for row in csv.DictReader(file)]


def _row(name: str, cells: dict[str, str]) -> Row:
    """Return a row's numbers and words, with all that its mission and policy depend on."""
    config = json.loads(cells.get("config") or "{}")
    own = {field: _number(cell) for field, cell in cells.items() if field != "config"}
    if isinstance(sent := own.get("bytes_per_second"), float):
        own["kilobytes_per_second"] = sent / 1e3
    return config | own | {"results": name, "is_published": False}


def _number(cell: str) -> float | str | None:
    """Return a cell as a number if it is one, and None if it is empty."""
    try:
        return float(cell)
    except ValueError:
        return cell or None


def _published() -> Rows:
    """Return the paper's points as rows: of each method and place, both costs."""
    found: dict[tuple[str, str, float], Row] = {}
    for point in points():
        figure = RESULT_FIGURES[point.figure.partition("_")[0]]
        row = found.setdefault((point.figure, point.method, point.x), {})
        row |= {"policy": point.method, "figure": figure.name, "task": figure.task}
        row |= {point.x_name: point.x, "is_published": True, "results": PAPER}
        row |= {f"{point.cost}_mean": point.mean, f"{point.cost}_sem": point.sem}
    return list(found.values())


def select(rows: Iterable[Row], where: Row) -> Rows:
    """Return the rows that have these values; a list of values stands for any of them."""
    return [row for row in rows if all(_is(row.get(key), value) for key, value in where.items())]


def _is(found: object, wanted: object) -> bool:
    if isinstance(wanted, list):
        return any(_is(found, each) for each in wanted)
    if wanted in ("none", None) and found in ("none", None):
        return True
    try:
        return math.isclose(float(str(found)), float(str(wanted)))
    except ValueError:
        return str(found) == str(wanted)


def origin(rows: Sequence[Row], again: str | None = None) -> str:
    """Return who made these numbers, and how to make them again; the paper's have no such line.

    Args:
        rows: What a table shows.
        again: The command that flies them, as Markdown; None is `make results` with their names.
    """
    ours = [row for row in rows if not row["is_published"]]
    said = []
    for name in dict.fromkeys(row["results"] for row in ours):
        [missions] = {_missions(row) for row in ours if row["results"] == name}
        said.append(f"`{name}`{missions}")
    commits = " and ".join(sorted({str(row["commit"]) for row in ours}))
    named = dict.fromkeys(row["results"] for row in ours if row["results"] not in NOT_FLOWN)
    studies = " ".join(dict.fromkeys(map(study_of, named)))
    command = again or (f'`make results STUDIES="{studies}"`' if studies else None)
    ending = f" {command} flies them again." if command else ""
    return f"*From {', '.join(said)}; commit {commits}.{ending}*"


def study_of(results: str) -> str:
    """Return the name by which `make results` knows what makes a table."""
    if results == "converging-late":
        return "converging-courses"
    return "gnn" if results.startswith("reproduce/") else results


def _missions(row: Row) -> str:
    if None in (row.get(name) for name in MISSIONS):
        return ""
    episodes, first = (int(row[name]) for name in MISSIONS)
    return f" ({episodes} missions, seeds {first} to {first + episodes - 1})"
