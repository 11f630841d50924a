"""Result files: written and read back as they were, and refused with a reason otherwise."""

import csv
from dataclasses import asdict, fields
from types import NoneType
from typing import get_args

import pytest

from swarm_mj.evaluation.results import COLUMNS, Result, read_results, write_results

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
        some_result(policy="a, b\n'c'", aoi_mean=0.1 + 0.2, age_worst=1e-300),
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
        ({"aoi_mean": "old"}, "line 3: aoi_mean must be a finite number from 0 to 1e9, not 'old'"),
        ({"aoi_mean": ""}, "line 3: aoi_mean must be a finite number from 0 to 1e9, not ''"),
        ({"aoi_mean": "nan"}, "aoi_mean must be a finite number from 0 to 1e9, not 'nan'"),
        ({"aoi_sem": "inf"}, "aoi_sem must be a finite number from 0 to 1e9, not 'inf'"),
        (
            {"aoi_difference_mean": "x"},
            "aoi_difference_mean must be a finite number from -1e9 to 1e9",
        ),
        ({"episodes": "100.0"}, "episodes must be a whole number, not '100.0'"),
        ({"policy": ""}, "policy must be a text, not ''"),
        ({"aoi_median": "-1"}, "aoi_median must be a finite number from 0 to 1e9, not '-1'"),
        ({"seed": "-1"}, "seed must be a whole number, not '-1'"),
        ({"seed": "9" * 30}, "seed must be a whole number, not '999"),
        ({"config": "x" * 10_001}, "config must be a text"),
        ({"task": "swim"}, "line 3: task must be one of stationary, random-walk, flocking"),
        (
            {"preset": "mine"},
            "preset must be one of paper, reference, indoor, urban, open-field, not 'mine'",
        ),
        ({"range_ratio": "0"}, r"range ratio must be a number from 0.01 to 10 \[of 1 km\], not 0"),
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
    without = [name for name in COLUMNS if name not in ("aoi_sem", "task")]
    (tmp_path / "r.csv").write_text(",".join(without) + "\n")
    with pytest.raises(ValueError, match=r"r\.csv lacks the columns task, aoi_sem; make them with"):
        read_results(tmp_path / "r.csv")
    (tmp_path / "r.csv").write_text(",".join(COLUMNS) + "\n")
    with pytest.raises(ValueError, match="has no rows"):
        read_results(tmp_path / "r.csv")
    with pytest.raises(ValueError, match=r"there is no results file .*none\.csv"):
        read_results(tmp_path / "none.csv")


def test_a_file_that_was_cut_off_is_refused(tmp_path):
    """Within the last cell, which is in quotes: a cut there leaves as many cells as before."""
    write_results(tmp_path / "r.csv", [some_result()])
    text = (tmp_path / "r.csv").read_text()
    (tmp_path / "r.csv").write_text(text[:-3])
    with pytest.raises(ValueError, match=r"no CSV \(unexpected end of data\)"):
        read_results(tmp_path / "r.csv")
