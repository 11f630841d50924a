"""Result files: written and read back as they were, and refused with a reason otherwise."""

import csv
from dataclasses import asdict, fields
from types import NoneType
from typing import get_args

import pytest

from swarm_mj.evaluation.results import COLUMNS, Result
from swarm_mj.evaluation.results_files import read_results, write_results

TEXTS = {
    "policy": "mst",
    "task": "flocking",
    "preset": "reference",
    "boundary": "none",
    "physics": "contact",
    "prior_knowledge": "map,start",
    "config": '{"a": "b, \\"c\\""}',
}


def some_result(**overrides):
    """A number of its own in every field: 1/300, 2/300, ..."""
    values = {}
    for position, spec in enumerate(fields(Result), start=1):
        kinds = get_args(spec.type) or (spec.type,)
        text = TEXTS.get(spec.name, f"some {spec.name}")
        values[spec.name] = {str: text, int: position, float: position / 300.0}[kinds[0]]
    return Result(**values | {"bit_rate": 250e3} | overrides)


OPTIONAL = [spec.name for spec in fields(Result) if NoneType in get_args(spec.type)]


def test_a_csv_comes_back_bit_for_bit(tmp_path):
    results = [
        some_result(),
        some_result(policy="a, b 'c' \"d\"", aoi_mean=0.1 + 0.2, age_worst=1e-300),
        some_result(**dict.fromkeys(OPTIONAL)),
    ]
    write_results(tmp_path / "new" / "r.csv", results)
    assert read_results(tmp_path / "new" / "r.csv") == results


def test_columns_are_read_by_former_names_too_and_others_are_passed_over(tmp_path):
    write_results(tmp_path / "r.csv", [some_result()])
    header, row = (tmp_path / "r.csv").read_text().splitlines()
    assert header == ",".join(COLUMNS)
    assert row.startswith(f"mst,flocking,reference,4,{5 / 300!r},")
    header = header.replace("failure_fraction", "switched_off").replace("prior_knowledge", "known")
    (tmp_path / "r.csv").write_text(f"remark,{header}\nby hand,{row}\n")
    assert read_results(tmp_path / "r.csv") == [some_result()]


def with_rows(path, *rows):
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    return path


@pytest.mark.parametrize(
    ("cells", "complaint"),
    [
        ({"aoi_mean": "old"}, r"line 3: Expected `float`, got `str` .*aoi_mean"),
        ({"aoi_mean": ""}, r"line 3: Expected `float`, got `null` .*aoi_mean"),
        ({"episodes": "1.5"}, r"Expected `int`, got `str` .*episodes"),
        ({"policy": ""}, r"Expected `str`, got `null` .*policy"),
    ],
)
def test_cells_that_are_not_what_they_must_be(tmp_path, cells, complaint):
    row = asdict(some_result())
    with_rows(tmp_path / "r.csv", row, row | cells)
    with pytest.raises(ValueError, match=complaint):
        read_results(tmp_path / "r.csv")


@pytest.mark.parametrize(
    ("new", "default"),
    [(("payload", "heard_ratio", "hearers_per_packet"), None), (("failure_fraction",), 0.0)],
)
def test_older_files_that_lack_columns_with_defaults_are_read(tmp_path, new, default):
    old = {name: cell for name, cell in asdict(some_result()).items() if name not in new}
    assert read_results(with_rows(tmp_path / "old.csv", old)) == [
        some_result(**dict.fromkeys(new, default))
    ]


def test_missing_columns_rows_and_files_are_named(tmp_path):
    without = {name: cell for name, cell in asdict(some_result()).items() if name != "task"}
    with pytest.raises(
        ValueError, match=r"line 2: .*missing required field `task`; make them with"
    ):
        read_results(with_rows(tmp_path / "r.csv", without))
    (tmp_path / "r.csv").write_text(",".join(COLUMNS) + "\n")
    with pytest.raises(ValueError, match="has no rows"):
        read_results(tmp_path / "r.csv")
    with pytest.raises(ValueError, match=r"results file .*none\.csv cannot be found"):
        read_results(tmp_path / "none.csv")


def test_a_file_that_was_cut_off_is_refused(tmp_path):
    """Within the last cell, which is in quotes: a cut there leaves as many cells as before."""
    write_results(tmp_path / "r.csv", [some_result()])
    text = (tmp_path / "r.csv").read_text()
    (tmp_path / "r.csv").write_text(text[:-3])
    with pytest.raises(ValueError, match=r"no CSV \(unexpected end of data\)"):
        read_results(tmp_path / "r.csv")
