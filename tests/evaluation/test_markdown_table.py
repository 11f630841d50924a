"""Tables as Markdown, letter by letter."""

import pytest

from swarm_mj.evaluation.markdown_table import markdown_table


def test_a_table_has_a_rule_below_its_head():
    shown = markdown_table(["policy", "age"], [["`tdma`", "2.0"], ["`mst`", ""]])
    assert shown == "| policy | age |\n| --- | --- |\n| `tdma` | 2.0 |\n| `mst` |  |"


@pytest.mark.parametrize(
    ("right_from", "rule"),
    [(None, "| --- | --- | --- |"), (1, "| --- | ---: | ---: |"), (2, "| --- | --- | ---: |")],
)
def test_columns_may_be_aligned_to_the_right(right_from, rule):
    assert markdown_table(["a", "b", "c"], [], right_from=right_from).splitlines()[1] == rule


def test_a_row_of_other_length_is_refused():
    with pytest.raises(ValueError, match="a row has 1 cells, not 2"):
        markdown_table(["policy", "age"], [["`tdma`"]])
