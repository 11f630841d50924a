"""What stands around the scene, found again in the picture."""

from dataclasses import replace

import numpy as np
import pytest
from moments import moment
from PIL import Image, ImageDraw

from swarm_mj.replay import palette
from swarm_mj.replay.links import LINK, LinkMismatch
from swarm_mj.replay.rendering.drawing import (
    SHADE,
    AgePlot,
    Box,
    draw_legend,
    draw_shortfalls,
    draw_title,
)
from swarm_mj.replay.rendering.theme import DARK

BOX = Box(20, 10, 380, 150)


def footage(age_mean, **facts):
    """A mission whose team of two stands still."""
    where = [(0.0, 0.0), (0.0, 0.0)]
    return replace(
        moment(where, num_windows=len(age_mean), **facts), age_mean=np.array(age_mean, dtype=float)
    )


def drawn(draw, *arguments):
    """A dark picture of 400 by 160 pixels after something was drawn on it."""
    picture = Image.new("RGB", (400, 160), palette.BACKGROUND)
    draw(ImageDraw.Draw(picture), *arguments)
    return picture


def has(picture, colour, tolerance=6):
    return np.abs(np.asarray(picture).astype(int) - colour).max(axis=2) <= tolerance


def test_a_constant_age_is_a_line_at_its_height():
    """10 of an axis to 10 is on top, 0 at the bottom."""
    heights = []
    for age in (10.0, 5.0, 0.001):
        picture = drawn(AgePlot([footage([age] * 5 + [10.0])], BOX, 10).draw_until, [4])
        rows, _ = np.nonzero(has(picture, palette.FILM_CURVES[0], 40))
        heights.append(np.median(rows))
    top, middle, bottom = heights
    assert top < middle < bottom
    np.testing.assert_allclose(middle, (top + bottom) / 2, atol=2)


def test_the_legend_names_what_is_drawn_only():
    samples = {}
    for is_broadcast in (True, False):
        seen = footage([1.0], is_broadcast=is_broadcast)
        picture = samples[is_broadcast] = drawn(draw_legend, [seen], BOX, 12)
        assert np.any(has(picture, palette.UNKNOWN))
        assert np.any(has(picture, (253, 231, 37)))  # the ramp's fresh end
    assert np.any(has(samples[False], palette.LOST))
    assert not np.any(has(samples[True], palette.LOST))


def with_one_too_weak(seen):
    """The same footage, in which robot 1 is cut off from robot 0 as their link is too weak."""
    links = LinkMismatch(np.array([1]), np.array([(0, 0, 1, 99, -11, True)], LINK))
    is_cut_off = np.tile([False, True], (len(seen.window), 1))
    return replace(seen, mismatch=links, is_cut_off=is_cut_off)


TOP = Box(0, 0, 400, 160)


def test_links_too_weak_and_robots_cut_off_are_named_and_counted_if_there_are_any():
    """Robot 0 is cut off from the only other one: columns as high as the plot."""
    found, heights = [], []
    for seen in (footage([10.0] * 5), with_one_too_weak(footage([10.0] * 5))):
        legend = drawn(draw_legend, [seen], BOX, 12)
        colours = (palette.MISMATCH["too_weak"], palette.CUT_OFF, palette.MISMATCH["unbelieved"])
        named = [bool(np.any(has(legend, colour, 0))) for colour in colours]
        title = drawn(draw_title, seen, 0, TOP, 12, (0, 255, 0))
        found.append([*named, bool(np.any(has(title, palette.TOO_WEAK, 20)))])
        is_red = has(
            drawn(AgePlot([seen], BOX, 10).draw_axes), DARK.mixed(palette.CUT_OFF, SHADE), 0
        )
        heights.append(np.sum(np.any(is_red, axis=1)))
    assert found == [[False] * 4, [True, True, False, True]]
    assert heights[0] == 0
    assert abs(heights[1] - (BOX.bottom - BOX.top - 10 - 14)) <= 2


def said(robots, others):
    """Where red texts are after shortfalls were drawn: rows and columns."""
    margin_db = -np.arange(3, 3 + len(others), dtype=np.int16)
    numbers = np.array(others, dtype=np.int16), margin_db
    picture = drawn(draw_shortfalls, np.array(robots), *numbers, 12)
    return np.nonzero(has(picture, palette.TOO_WEAK, 60))


@pytest.mark.parametrize(
    ("robots", "low", "high"),
    [([[300, 90], [50, 50]], 55, 100), ([[300, 90], [150, 50], [175, 50]], 50, 145)],
)
def test_a_shortfall_stands_next_to_the_far_robot_and_covers_no_other(robots, low, high):
    """To the right of robot 1, or to its left if there is another robot."""
    rows, columns = said(np.array(robots, dtype=float), [1])
    assert low < columns.min() <= columns.max() < high
    assert abs(np.mean(rows) - 50.0) < 3.0


def test_shortfalls_do_not_cover_each_other():
    """Around one place there is room for four, and what more there is is left out."""
    four, eight = (len(said([[200.0, 80.0]] * num, range(num))[0]) for num in (4, 8))
    assert four == eight > 0


def test_a_shortfall_stands_on_dark_ground():
    picture = Image.new("RGB", (400, 160), "white")
    one = np.array([0], dtype=np.int16)
    draw_shortfalls(ImageDraw.Draw(picture), np.array([[200.0, 80.0]]), one, one - 9, 12)
    rows, columns = np.nonzero(has(picture, palette.TOO_WEAK, 60))
    around = np.asarray(picture)[rows.min() - 1, columns.min() : columns.max()]
    assert np.all(around == palette.BACKGROUND)


def test_the_title_stays_in_its_part_of_the_picture():
    box = Box(100, 0, 400, 160)
    picture = drawn(draw_title, footage([1.0, 2.0]), 1, box, 12, (255, 0, 0))
    pixels = np.asarray(picture)
    assert np.all(pixels[:, :100] == palette.BACKGROUND)
    assert np.any(has(picture, palette.TEXT))
    assert np.any(has(picture, (255, 0, 0)))


def test_a_title_has_a_line_for_each_part_of_ones_own():
    lowest = []
    for parts in ({}, {"channel": "my:Radio"}, {"channel": "my:Radio", "scene": "my:walls"}):
        picture = drawn(draw_title, footage([1.0], **parts), 0, TOP, 12, (255, 0, 0))
        rows, _ = np.nonzero(~has(picture, palette.BACKGROUND))
        lowest.append(rows.max())
    assert np.all(np.diff(lowest) >= 8)
