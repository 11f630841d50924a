"""The tables and numbers of the docs, from made-up results."""

import pytest
import results_table as tool
from results_table import table, value
from synthetic import result, sweep

from swarm_mj.evaluation.results_files import write_results
from swarm_mj.system.exit_codes import BAD_INPUT, DONE, FAILED

ORIGIN = (
    '*From `some` (4 missions, seeds 50 to 53); commit abc123. `make results STUDIES="some"` flies '
    "them again.*"
)
BY_RANGE = {"results": "some", "columns": {"range_ratio": [0.25, 0.5]}}


@pytest.fixture
def made(tmp_path):
    """Writes results, and returns their folder."""

    def made_of(rows, name="some"):
        write_results(tmp_path / f"{name}.csv", rows)
        return tmp_path

    return made_of


def ranges(policy, *ages, **overrides):
    return sweep(policy, "range_ratio", dict(zip((0.25, 0.5), ages, strict=False)), **overrides)


def cells(shown):
    """The lines of a table, without its head and its origin."""
    return [line for line in shown.splitlines() if line.startswith("|")][2:]


def test_columns_are_the_values_of_a_field_and_rows_all_policies_the_least_age_first(made):
    mst = ranges("mst", (43.0, 1.0), (16.54, 0.1))
    folder = made([*mst, *ranges("greedy-oracle", (12.04, 0.06), (5.0, 0.25))])
    assert table(BY_RANGE | {"head": "policy, by range"}, folder) == (
        "| policy, by range | 0.25 | 0.5 |\n"
        "| --- | --- | --- |\n"
        "| `greedy-oracle` | 12.0 ± 0.1 | 5.0 ± 0.2 |\n"
        "| `mst` | 43.0 ± 1.0 | 16.5 ± 0.1 |\n\n" + ORIGIN
    )


def test_rows_that_are_named_stand_in_their_order_and_others_are_left_out(made):
    rows = [result(policy, aoi_mean=float(n)) for n, policy in enumerate(("mst", "aloha", "tdma"))]
    spec = {
        "results": "some",
        "form": "{aoi_mean:.2f}",
        "columns": [{"head": "here", "task": "stationary"}],
        "rows": ["tdma", {"head": "a tree", "policy": "mst"}],
    }
    assert cells(table(spec, made(rows))) == ["| `tdma` | 2.00 |", "| a tree | 0.00 |"]


def test_rows_of_more_stand_below_and_their_results_may_be_others(made):
    folder = made(ranges("mst", (2.0, 0.1), (2.0, 0.1)))
    made(ranges("tdma", (1.0, 0.1), (1.0, 0.1)), "others")
    spec = BY_RANGE | {"more": [{"head": "turns", "results": "others", "policy": "tdma"}]}
    shown = table(spec, folder)
    assert cells(shown) == [
        "| `mst` | 2.0 ± 0.1 | 2.0 ± 0.1 |",
        "| turns | 1.0 ± 0.1 | 1.0 ± 0.1 |",
    ]
    assert "`some` (4 missions, seeds 50 to 53), `others` (4 missions" in shown
    assert 'STUDIES="some others"' in shown


def test_another_order_is_that_of_the_named_field(made):
    rows = [
        result("mst", aoi_mean=1.0, aoi_median=3.0, aoi_p95=9.0),
        result("tdma", aoi_mean=2.0, aoi_median=2.0, aoi_p95=8.0),
    ]
    spec = {"results": "some", "order": "aoi_median", "form": "{aoi_median:.1f}, {aoi_p95:.1f}"}
    spec["columns"] = [{"head": "age"}]
    assert cells(table(spec, made(rows))) == ["| `tdma` | 2.0, 8.0 |", "| `mst` | 3.0, 9.0 |"]


def test_published_values_stand_in_brackets_where_there_are_some(made):
    papers = {"published_aoi_mean": 46.2565, "published_aoi_sem": 1.48173}
    none = dict.fromkeys(papers)
    rows = [
        *ranges("mst", (46.0, 1.25), **papers),
        *ranges("tdma", (47.0, 1.0), **none),
    ]
    shown = cells(table(BY_RANGE, made(rows)))
    assert shown == ["| `mst` | 46.0 ± 1.2 (46.3 ± 1.5) |  |", "| `tdma` | 47.0 ± 1.0 |  |"]


def test_the_papers_own_points_have_no_origin(made):
    spec = {
        "results": ["some", "published"],
        "columns": [{"head": "at rest", "range_ratio": 0.25}],
        "rows": ["tdma", {"head": "theirs", "policy": "GNN", "figure": "fig4"}],
    }
    shown = table(spec, made(ranges("tdma", (26.0, 0.5))))
    assert cells(shown) == ["| `tdma` | 26.0 ± 0.5 |", "| theirs | 34.8 ± 0.7 |"]
    assert shown.endswith(ORIGIN)


def test_a_cell_that_two_results_could_fill_is_refused(made):
    rows = [result("mst", aoi_mean=43.0), result("mst", aoi_mean=50.0, failure_fraction=0.2)]
    folder = made(rows)
    with pytest.raises(ValueError, match=r"2 results have .*'mst'.*; name what tells them apart"):
        table(BY_RANGE, folder)
    shown = table(BY_RANGE | {"where": {"failure_fraction": 0}}, folder)
    assert cells(shown) == ["| `mst` | 43.0 |  |"]


def test_a_missing_cell_is_empty_and_a_table_without_numbers_is_refused(made):
    folder = made([*ranges("mst", (43.0, 1.0)), *ranges("tdma", (50.0, 1.0), (9.0, 0.1))])
    assert cells(table(BY_RANGE, folder)) == [
        "| `tdma` | 50.0 ± 1.0 | 9.0 ± 0.1 |",
        "| `mst` | 43.0 ± 1.0 |  |",
    ]
    with pytest.raises(ValueError, match="the table of some has no numbers"):
        table(BY_RANGE | {"rows": ["aloha"]}, folder)


@pytest.mark.parametrize(
    ("misspelt", "said"),
    [
        ({"ordre": "aoi_median"}, "a table has no ordre; it has "),
        ({"where": {"tsak": "flocking"}}, "no result has a column tsak; name one of theirs"),
        ({"rows": [{"polycy": "mst"}]}, "no result has a column polycy; name one of theirs"),
    ],
)
def test_a_misspelt_key_is_refused_and_leaves_no_empty_cell(made, misspelt, said):
    folder = made(ranges("mst", (43.0, 1.0), (16.5, 0.1)))
    with pytest.raises(ValueError, match=said):
        table(BY_RANGE | misspelt, folder)


def test_names_say_what_packets_carry_and_what_is_no_policy(made):
    rows = [
        result("planner", aoi_mean=1.0, payload="snapshots"),
        result("planner --payload none", aoi_mean=2.0, payload="none"),
        result("training.ceiling:Annealed", aoi_mean=3.0),
        result("mine.py:Mine", aoi_mean=4.0),
    ]
    shown = cells(table(BY_RANGE, made(rows)))
    assert [line.split(" | ")[0] for line in shown] == [
        "| `planner` (larger packets)",
        "| `planner --payload none`",
        "| searched schedule (a ceiling, [no policy for a team](bounds.md))",
        "| mine.py:Mine",
    ]


def test_facts_are_what_a_policy_says_of_itself_or_what_the_row_says(made):
    spec = {
        "results": "some",
        "columns": [
            {"head": "carries", "fact": "payload"},
            {"head": "uses", "fact": "beyond_paper"},
            {"head": "age", "form": "{aoi_mean}"},
        ],
        "rows": ["planner", "mst", {"policy": "mine.py:Mine", "payload": "-", "beyond_paper": "-"}],
    }
    uses = [line.split(" | ") for line in cells(table(spec, made([result("mst", aoi_mean=2.5)])))]
    assert [line[1] for line in uses] == ["snapshots", "nothing", "-"]
    assert uses[0][2].startswith("common order, clock, team size, ")
    assert [line[2] for line in uses[1:]] == ["nothing", "-"]
    assert [line[3] for line in uses] == [" |", "2.5 |", " |"]


def test_a_function_makes_its_table_and_named_results_their_origin(made, tmp_path, monkeypatch):
    (tmp_path / "my_figure.py").write_text("def table(folder): return f'| {folder.name} |'")
    monkeypatch.syspath_prepend(tmp_path)
    folder = made([result("mst")])
    spec = {"function": "my_figure:table"}
    assert table(spec, folder) == f"| {folder.name} |"
    assert table(spec | {"results": ["some"]}, folder) == f"| {folder.name} |\n\n{ORIGIN}"


def test_a_number_of_a_sentence_is_that_of_the_one_row_that_has_the_keys(made):
    ages = {"mst": 43.25, "planner --payload none": 9.0}
    folder = made([result(policy, aoi_mean=age, num_robots=20) for policy, age in ages.items()])
    assert value("some policy=mst num_robots=20 {aoi_mean:.1f}", folder) == "43.2"
    assert value('some "policy=planner --payload none" {aoi_mean:.2f}', folder) == "9.00"
    with pytest.raises(ValueError, match=r"0 results of some .* not 1"):
        value("some policy=mst num_robots=40 {aoi_mean:.1f}", folder)
    with pytest.raises(ValueError, match=r"2 results of some .* not 1"):
        value("some num_robots=20 {aoi_mean:.1f}", folder)
    with pytest.raises(ValueError, match="some has no such number"):
        value("some policy=mst {aoi_median_of_all:.1f}", folder)


@pytest.fixture
def page(made, tmp_path, monkeypatch):
    """The one page of docs, with a table and a number."""
    folder = made(ranges("mst", (43.0, 1.0), (16.54, 0.1)))
    path = tmp_path / "page.md"
    path.write_text(
        "# Ages\n\n<!-- table: ages -->\n\nold\n\n<!-- end -->\n\nText of <!-- value: some "
        "range_ratio=0.5 {aoi_mean:.1f} -->9<!-- end --> windows.\n"
    )
    monkeypatch.setattr(tool, "ROOT", tmp_path)
    monkeypatch.setattr(tool, "PAGES", (path,))
    monkeypatch.setattr(tool, "TABLES", {"ages": BY_RANGE})
    return path, ["--results", str(folder)]


def test_a_page_is_checked_and_written(page, capsys):
    path, results = page
    before = path.read_text()
    assert tool.main([*results, "--check"]) == FAILED
    assert capsys.readouterr().out == "page.md differs\n"
    assert path.read_text() == before
    assert tool.main(results) == DONE
    assert capsys.readouterr().out == "page.md is written\n"
    assert path.read_text() == (
        "# Ages\n\n<!-- table: ages -->\n\n"
        "| policy | 0.25 | 0.5 |\n| --- | --- | --- |\n| `mst` | 43.0 ± 1.0 | 16.5 ± 0.1 |\n\n"
        f"{ORIGIN}\n\n<!-- end -->\n\n"
        "Text of <!-- value: some range_ratio=0.5 {aoi_mean:.1f} -->16.5<!-- end --> windows.\n"
    )
    assert tool.main([*results, "--check"]) == DONE
    assert capsys.readouterr().out == ""


def test_the_structure_is_tried_without_writing_also_of_tables_on_no_page(
    page, monkeypatch, capsys
):
    path, results = page
    before = path.read_text()
    assert tool.main([*results, "--structure"]) == DONE
    assert "All 1 tables of the docs can be made" in capsys.readouterr().out
    monkeypatch.setitem(tool.TABLES, "other", {"results": "none", "columns": [{"head": "age"}]})
    assert tool.main([*results, "--structure"]) == BAD_INPUT
    assert "other: " in capsys.readouterr().err
    assert path.read_text() == before


def test_a_page_that_cannot_be_filled_is_named(page, capsys):
    path, results = page
    path.write_text("<!-- table: agess -->\n\n<!-- end -->\n")
    assert tool.main(results) == BAD_INPUT
    assert "page.md: tables.toml has no table agess" in " ".join(capsys.readouterr().err.split())
