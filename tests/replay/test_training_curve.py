"""The learning curve beside a mission: its axes, its lines and their names, read back."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reading import static
from rerun.chunk import RrdReader

from swarm_mj.replay.rerun_log import RerunLog
from swarm_mj.replay.training_curve import (
    LINE,
    SIZE,
    TrainingCurve,
    cost_axis,
    draw_training_curve,
    spread,
)
from swarm_mj.replay.write import new_recording

CURVE = TrainingCurve(
    title="age of information [windows]",
    digits=2,
    decisions=np.array([0.0, 4096.0, 8192.0]),
    cost=np.array([40.0, 20.0, 10.0]),
    sem=np.array([4.0, 0.0, 1.0]),
    references={"tdma": 11.0, "spatial-tdma": 10.5, "greedy-oracle": 5.0},
)
WIDTH, HEIGHT = SIZE


@pytest.mark.parametrize(
    ("values", "ticks"),
    [
        ([7.6, 96.3], [5.0, 10.0, 20.0, 50.0, 100.0]),
        ([10.0], [10.0, 20.0]),
        ([0.031, 0.09], [0.02, 0.05, 0.1]),
        ([5.0, 9.0], [5.0, 10.0]),
        ([0.0, 3.4], [0.0, 4.0]),
        ([0.0], [0.0, 1.0]),
    ],
)
def test_the_axis_is_from_a_round_number_to_the_next_above_all(values, ticks):
    axis = cost_axis(values)
    assert axis.ticks == pytest.approx(ticks)
    assert axis.is_log == (min(values) > 0.0)


def test_heights_are_by_the_logarithm_and_end_with_the_axis():
    axis = cost_axis([10.0, 1000.0])
    heights = axis.share(np.array([1.0, 10.0, 100.0, 1000.0, 1e6]))
    np.testing.assert_allclose(heights, [0.0, 0.0, 0.5, 1.0, 1.0])
    np.testing.assert_allclose(cost_axis([0.0, 4.0]).share(np.array([1.0])), [0.25])


def test_names_that_have_room_stay_and_others_move_apart_by_the_same():
    assert spread([50.0, 0.0, 100.0], 20.0) == [50.0, 0.0, 100.0]
    assert spread([52.0, 48.0], 20.0) == [60.0, 40.0]
    assert spread([0.0, 10.0, 11.0, 100.0], 20.0) == [-13.0, 7.0, 27.0, 100.0]
    assert sorted(spread([7.0, 7.0], 10.0)) == [2.0, 12.0]


@given(st.lists(st.floats(0.0, 300.0), min_size=1, max_size=6))
def test_no_name_covers_another_and_their_order_is_that_of_the_lines(heights):
    places = spread(heights, LINE)
    order = np.argsort(heights, kind="stable")
    for first, second in itertools.pairwise(order):
        assert places[second] - places[first] >= LINE - 1e-9


@pytest.fixture
def drawn(two_way, tmp_path):
    def draw(curve):
        path = tmp_path / "a.rrd"
        with new_recording(two_way.log, curve) as recording:
            recording.save(path)
            draw_training_curve(RerunLog([recording], two_way.log), curve)
        return path

    return draw


def strips(path, entity):
    """The lines of an entity: the points of each, whose numbers differ."""
    for chunk in RrdReader(path).stream().filter(content=entity):
        batch = chunk.to_record_batch()
        if "LineStrips2D:strips" in batch.schema.names:
            (lines,) = batch.column("LineStrips2D:strips").to_pylist()
    return [np.array(line) for line in lines]


def height_of(cost):
    """By the axis from 5 to 50, y down."""
    return HEIGHT * (1.0 - np.log(cost / 5.0) / np.log(10.0))


def test_all_evaluations_are_points_of_a_line_by_their_decisions_and_costs(drawn):
    path = drawn(CURVE)
    points = static(path, "/learning/points", "Points2D:positions").reshape(-1, 2)
    expected = [(WIDTH * share, height_of(40.0 / 2**n)) for n, share in enumerate((0, 0.5, 1))]
    np.testing.assert_allclose(points, expected, rtol=1e-5, atol=1e-4)
    line = static(path, "/learning/curve", "LineStrips2D:strips").reshape(-1, 2)
    np.testing.assert_allclose(line, points)
    newest = static(path, "/learning/newest", "Points2D:positions")
    np.testing.assert_allclose(newest, points[-1])
    bars = static(path, "/learning/errors", "LineStrips2D:strips").reshape(-1, 2, 2)
    for bar, mean, sem in zip(bars, CURVE.cost, CURVE.sem, strict=True):
        ends = [height_of(mean - sem), height_of(mean + sem)]
        np.testing.assert_allclose(bar[:, 1], ends, rtol=1e-5, atol=1e-4)


def test_references_are_level_lines_with_their_names_as_typed(drawn):
    path = drawn(CURVE)
    names = static(path, "/learning/names", "Points2D:labels").tolist()
    assert names == [
        "policy in training 10.00",
        "tdma 11.00",
        "spatial-tdma 10.50",
        "greedy-oracle 5.00",
    ]
    colours = static(path, "/learning/references", "LineStrips2D:colors")
    assert len(set(colours.tolist())) == 4
    # That of the policy, whose line is the curve, only leads from its end to its name.
    own, *levels = strips(path, "/learning/references")
    assert own[0] == pytest.approx([WIDTH, height_of(10.0)], rel=1e-5)
    for level, cost in zip(levels, CURVE.references.values(), strict=True):
        ends = [[0.0, height_of(cost)], [WIDTH, height_of(cost)]]
        np.testing.assert_allclose(level[:2], ends, rtol=1e-5, atol=1e-4)


def test_the_ticks_have_numbers(drawn):
    ticks = static(drawn(CURVE), "/learning/ticks", "Points2D:labels").tolist()
    assert ticks[:4] == ["5", "10", "20", "50"]
    assert ticks[4:] == ["0", "2,000", "4,000", "6,000", "8,000", "team decisions"]


def test_the_first_evaluation_alone_is_a_point_at_no_decisions(drawn):
    first = TrainingCurve(
        title="a",
        digits=1,
        decisions=np.array([0.0]),
        cost=np.array([30.0]),
        sem=np.array([40.0]),  # more than the mean: it ends with the axis
        references={},
    )
    path = drawn(first)
    ticks = static(path, "/learning/ticks", "Points2D:labels").tolist()
    assert ticks[-2:] == ["0", "team decisions"]
    assert ticks.count("0") == 1
    names = static(path, "/learning/names", "Points2D:labels").tolist()
    assert names == ["policy in training 30.0"]
