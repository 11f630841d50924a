"""Columns of tables: what their headings and cells hold."""

from dataclasses import fields
from typing import get_args

import pytest

from swarm_mj.evaluation.results import Result
from swarm_mj.evaluation.table_columns import BRIEF, WIDE, interval, number, plus_minus, said


def some_result(**overrides):
    """A result whose numbers are 1."""
    values = {}
    for spec in fields(Result):
        kinds = get_args(spec.type) or (spec.type,)
        values[spec.name] = {str: f"some {spec.name}", int: 1, float: 1.0}[kinds[0]]
    return Result(**values | overrides)


@pytest.mark.parametrize("columns", [BRIEF, WIDE])
@pytest.mark.parametrize("cost", ["velocity variance", "spread"])
@pytest.mark.parametrize("task", ["stationary", "flocking"])
def test_every_column_shown_has_a_heading_of_its_own_and_at_most_two_lines(columns, cost, task):
    result = some_result(task=task, task_cost_name=cost)
    shown = [each for each in columns if each.applies is None or each.applies(result)]
    headings = [said(each.heading, result) for each in shown]
    assert len(set(headings)) == len(headings)
    for heading, column_shown in zip(headings, shown, strict=True):
        cell = column_shown.cell(result)
        assert cell
        assert max(heading.count("\n"), cell.count("\n")) <= 1


def test_what_does_not_exist_is_a_dash_or_left_out():
    assert (number(1.234), number(0.5, ".0%"), number(None)) == ("1.23", "50%", "-")
    assert plus_minus(1.234, 0.5) == "1.23 ± 0.50"
    assert plus_minus(1.234, None) == "1.23"
    assert interval(1.0, 2.345) == "1.00, 2.35"
    assert interval(1.0, None) == interval(None, 2.0) == ""


def cell_of(heading, result):
    """The cell under a heading of the wide table."""
    (found,) = [each for each in WIDE if each.heading == heading]
    return found.cell(result)


def test_a_cells_lines_are_those_that_its_heading_names():
    """Of broadcasts, none has an addressee, so what was reached is anybody."""
    result = some_result(
        packets_per_window=3.5,
        delivery_ratio=None,
        heard_ratio=0.75,
        hearers_per_packet=1.25,
        packet_bytes=1367,
        velocity_variance_mean=0.12345,
        agreed_share=0.5,
        agreed_window_median=35.5,
    )
    assert cell_of("packets\nreached", result) == "3.50\n75%"
    assert cell_of("hearers\nbytes", result) == "1.25\n1,367"
    assert cell_of("variance\nagreed", result) == "0.1235\n50%, 36"
    never = some_result(agreed_share=0.25, agreed_window_median=None)
    assert cell_of("variance\nagreed", never) == "1.0000\n25%"
    addressed = some_result(packets_per_window=3.5, delivery_ratio=0.25, heard_ratio=None)
    assert cell_of("packets\nreached", addressed) == "3.50\n25%"
