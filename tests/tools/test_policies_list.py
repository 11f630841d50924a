"""The list of policies in the docs agrees with what `swarm-mj policies` says."""

import json
import tomllib
from pathlib import Path

import policies_list
import pytest

from swarm_mj.cli import main
from swarm_mj.policies.registry import POLICIES

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def rows():
    lines = policies_list.table(ROOT).splitlines()
    cells = [line.strip("| ").split(" | ") for line in lines if line.startswith("|")]
    assert {len(each) for each in cells} == {5}
    return {name: rest for name, *rest in cells[2:]}


def test_every_policy_has_a_row_and_the_planner_one_for_each_kind_of_team(rows):
    others = [f"`{name}`" for name in POLICIES if name != "planner"]
    assert sorted(rows) == sorted([*others, "`planner`, at rest", "`planner`, moving"])


@pytest.mark.parametrize(
    ("row", "name", "task"),
    [
        ("`planner`, at rest", "planner", "stationary"),
        ("`planner`, moving", "planner", "random-walk"),
        ("`planner --payload none`", "planner --payload none", "stationary"),
        ("`spatial-tdma`", "spatial-tdma", "flocking"),
        ("`mst`", "mst", "flocking"),
    ],
)
def test_a_row_says_what_the_command_says(rows, row, name, task, capsys):
    assert main(["policies", name, "--task", task, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    window, uses, carried, num_bytes = rows[row]
    assert window.endswith("response") == (said["window"] == "request")
    assert uses.removeprefix("*centralised:* ").replace("`", "") == said["uses"]
    assert uses.startswith("*centralised:*") == said["is_centralised"]
    assert carried.partition(":")[0] == said["payload"].replace("none", "nothing")
    assert num_bytes == f"{said['packet_bytes']:,}"


def test_names_are_code_and_parts_of_other_names_are_not(rows):
    assert rows["`spatial-tdma`"][1].startswith("as `tdma`, ")
    assert "moving teams fly `spatial-tdma`" in rows["`planner --payload none`"][1]
    assert "(moving teams of `--preset reference`: " in rows["`mst`"][1]


def test_the_docs_have_the_list():
    spec = tomllib.loads((ROOT / "tools/tables.toml").read_text("utf-8"))["policies-list"]
    assert spec["function"] == "policies_list:table"
    listed = f"<!-- table: policies-list -->\n\n{policies_list.table(ROOT)}\n\n<!-- end -->"
    assert listed in (ROOT / "docs/policies.md").read_text("utf-8")
