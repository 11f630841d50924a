"""Missions as rows of Parquet, and their differences by hand."""

import json
import re
from dataclasses import asdict, fields, replace

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from pyarrow import parquet

import swarm_mj
from swarm_mj.evaluation.missions_table import LATER, compared, read_missions, write_missions
from swarm_mj.evaluation.results import CONVERGENCE
from swarm_mj.mission import Mission, paper
from swarm_mj.protocol.mission_costs import AOI, TASK_COST
from swarm_mj.simulation.components import CALLED_WITH

MISSION = paper("flocking", num_robots=5, num_windows=6, range_ratio=1.0)


@pytest.fixture(scope="module")
def flown():
    """Three missions from seed 5, of two policies."""
    return swarm_mj.evaluate(("mst", "tdma"), MISSION, num_missions=3, seed=5).results


@pytest.fixture
def written(flown, tmp_path):
    """Writes missions of the first policy with these ages from a seed on; returns the file."""

    def write(name, ages, seed=5, **fields):
        result = replace(flown[0].result, seed=seed, config=json.dumps(asdict(MISSION) | fields))
        own = replace(flown[0], result=result, aoi=ages, velocity_variance=ages, task_cost=None)
        own = replace(own, agreed_window=None, decay_rate=None, strayed=None)
        write_missions(tmp_path / name, [own])
        return tmp_path / name

    return write


def test_a_file_has_a_row_for_each_mission_with_its_fields_and_the_study(flown, tmp_path):
    path = tmp_path / "m.parquet"
    write_missions(path, flown)
    rows = pd.read_parquet(path)
    assert list(rows["policy"]) == ["mst"] * 3 + ["tdma"] * 3
    assert list(rows["seed"]) == [5, 6, 7] * 2
    mst, tdma = flown
    assert list(rows["aoi"]) == mst.aoi + tdma.aoi
    assert list(rows["velocity_variance"]) == mst.velocity_variance + tdma.velocity_variance
    assert list(rows["task_cost"]) == mst.task_cost + tdma.task_cost
    for name in CONVERGENCE:
        told = rows[name].astype(object).where(rows[name].notna(), None)
        assert list(told) == getattr(mst, name) + getattr(tdma, name)
    for spec in fields(Mission):
        (value,) = set(rows[spec.name].astype(object).where(rows[spec.name].notna(), None))
        assert value == getattr(MISSION, spec.name), spec.name
    study = json.loads(parquet.read_schema(path).metadata[b"study"])
    assert (study["seed"], study["episodes"], study["baseline"]) == (5, 3, "mst")
    assert study["version"] == flown[0].result.version
    assert study["policies and regimes"] == [json.loads(each.result.config) for each in flown]
    assert read_missions(path).equals(rows)


def test_files_of_before_flocks_said_how_they_agree_are_read(written, tmp_path):
    table = parquet.read_table(written("m.parquet", [1.0, 2.0]))
    parquet.write_table(table.drop_columns(list(LATER)), tmp_path / "old.parquet")
    assert read_missions(tmp_path / "old.parquet")[list(LATER)].isna().all(axis=None)


def test_columns_have_kinds_even_where_no_mission_has_a_value(written):
    kinds = parquet.read_schema(written("m.parquet", [1.0, 2.0, 3.0]))
    assert {str(kinds.field(n).type) for n in ("bit_rate", "task_cost", "range_ratio")} == {
        "double"
    }
    assert {str(kinds.field(n).type) for n in ("channel", "task", "policy")} == {"string"}
    assert (str(kinds.field("seed").type), str(kinds.field("collide").type)) == ("int64", "bool")


def test_differences_are_of_the_same_seeds_by_hand(written):
    """Seeds 5 to 8 before, 6 to 9 after: of 6, 7 and 8 the differences are 1, 2 and 6."""
    before = read_missions(written("a.parquet", [90.0, 10.0, 20.0, 30.0]))
    after = read_missions(written("b.parquet", [11.0, 22.0, 36.0, 99.0], seed=6))
    (row,) = compared(before, after, AOI).to_dict("records")
    assert (row["policy"], row["before"], row["after"], row["difference"]) == ("mst", 20, 23, 3)
    assert 1.0 <= row["low"] < 3.0 < row["high"] <= 6.0
    assert (row["missions"], row["only before"], row["only after"]) == (3, 1, 1)
    assert compared(before, after, TASK_COST).empty


def test_regimes_are_told_apart_by_what_differs_and_those_that_one_lacks_are_shown(written):
    paths = [written(f"{x}.parquet", [10.0, 12.0], erasure=x) for x in (0.0, 0.1, 0.3)]
    none, some, much = map(read_missions, paths)
    table = compared(pd.concat([none, some]), pd.concat([some, much]), AOI)
    assert list(table.columns[:2]) == ["erasure", "policy"]
    assert list(table["erasure"]) == [0.0, 0.1, 0.3]
    assert list(table["missions"]) == [0, 2, 0]
    assert (list(table["only before"]), list(table["only after"])) == ([2, 0, 0], [0, 0, 2])
    np.testing.assert_array_equal(table["before"], [11.0, 11.0, np.nan])
    np.testing.assert_array_equal(table["difference"], [np.nan, 0.0, np.nan])


def test_a_file_without_a_newer_field_had_its_default(written):
    path = written("m.parquet", [1.0, 2.0])
    older = pd.read_parquet(path).drop(columns="erasure")
    older.to_parquet(path)
    assert set(read_missions(path)["erasure"]) == {Mission().erasure}
    newer = read_missions(written("n.parquet", [2.0, 4.0]))
    assert list(compared(read_missions(path), newer, AOI)["difference"]) == [1.5]


def test_what_is_no_parquet_is_refused(tmp_path):
    (tmp_path / "r.csv").write_text("policy\nmst\n")
    with pytest.raises(ValueError, match=r"missions .*r\.csv: .*make them with --parquet"):
        read_missions(tmp_path / "r.csv")


def changed(path, **columns):
    """A file with other columns; None leaves one out."""
    table = parquet.read_table(path)
    for name, values in columns.items():
        index = table.schema.get_field_index(name)
        table = table.remove_column(index)
        if values is not None:
            table = table.append_column(name, pa.array(values))
    parquet.write_table(table, path)
    return path


NEEDED = [
    *("seed", "policy", "aoi", "task_cost", "velocity_variance"),
    *(name for name in CALLED_WITH if name not in LATER),
]
FOREIGN = {  # two values in place of a column's, and what is said of them
    "lists": ("aoi", [[1.0], [2.0]], "column aoi must hold double, not list<"),
    "dicts": ("policy", [{"a": 1}, {"a": 2}], "column policy must hold string, not struct<"),
    "texts": ("task_cost", ["1.0", "2.0"], "column task_cost must hold double, not string"),
    "numbers": ("task", [1, 2], "column task must hold string, not int64"),
    "truths": ("seed", [True, False], "column seed must hold int64, not bool"),
    "fractions": ("seed", [1.5, 2.5], "column seed must hold int64, not double"),
    "huge": ("seed", pa.array([2**63, 1], pa.uint64()), "9223372036854775808"),
    "bytes": ("policy", [b"mst", b"\xff"], "column policy must hold string, not binary"),
    "gaps": ("num_robots", [5, None], "column num_robots lacks 1 values"),
    "infinite": ("aoi", [1.0, np.inf], "column aoi holds an infinite number"),
}


@pytest.mark.parametrize("name", NEEDED)
def test_a_file_without_a_column_is_refused_by_its_name(written, name):
    path = changed(written("m.parquet", [1.0, 2.0]), **{name: None})
    with pytest.raises(ValueError, match=rf"m\.parquet: it has no column {name}; make them with"):
        read_missions(path)


@pytest.mark.parametrize("case", FOREIGN)
def test_columns_that_hold_something_else_are_refused(written, case):
    name, values, said = FOREIGN[case]
    path = changed(written("m.parquet", [1.0, 2.0]), **{name: values})
    with pytest.raises(ValueError, match=rf"^missions .*m\.parquet: .*{re.escape(said)}"):
        read_missions(path)


def test_what_other_programs_add_or_store_otherwise_changes_nothing(written):
    """Larger texts, an index, metadata that lies, and columns of theirs."""
    path = written("m.parquet", [1.0, 2.0])
    before = read_missions(path)
    table = parquet.read_table(path)
    policies = pa.array(["mst", "mst"], pa.large_string())
    table = table.set_column(0, "policy", policies).append_column("mine", pa.array([[1], [2]]))
    lies = {b"pandas": b'{"index_columns": ["none"], "columns": 3}'}
    parquet.write_table(table.replace_schema_metadata(lies), path)
    assert read_missions(path).equals(before)


def test_a_file_with_a_mission_twice_is_refused(written):
    path = written("m.parquet", [1.0, 2.0])
    table = parquet.read_table(path)
    parquet.write_table(pa.concat_tables([table, table]), path)
    rule = "policy mst and seed 5 is there more than once, as are 1 others"
    with pytest.raises(ValueError, match=rf"m\.parquet: .*{rule}"):
        read_missions(path)


def test_a_file_without_missions_is_refused(written):
    path = written("m.parquet", [1.0, 2.0])
    parquet.write_table(parquet.read_table(path).slice(0, 0), path)
    with pytest.raises(ValueError, match="has from 1 to 10000000 missions, not 0"):
        read_missions(path)


def test_a_column_that_is_there_twice_is_refused(written):
    path = written("m.parquet", [1.0, 2.0])
    table = parquet.read_table(path)
    parquet.write_table(table.append_column("aoi", table.column("aoi")), path)
    with pytest.raises(ValueError, match="several columns aoi"):
        read_missions(path)
