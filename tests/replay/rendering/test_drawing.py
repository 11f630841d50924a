"""What stands around the scene, found again in the picture."""

from dataclasses import replace

import numpy as np
from PIL import ImageDraw

from swarm_mj.mission import paper
from swarm_mj.replay import palette
from swarm_mj.replay.footage import Facts, Footage
from swarm_mj.replay.mismatch import LinkMismatch
from swarm_mj.replay.rendering.drawing import (
    SHADE,
    AgePlot,
    Box,
    blank,
    draw_legend,
    draw_shortfalls,
    draw_title,
)

BOX = Box(20, 10, 380, 150)


def footage(age_mean, *, is_broadcast=False):
    """A mission whose team stands still."""
    num = len(age_mean)
    facts = Facts(
        mission=paper("stationary", num_robots=2),
        policy="mst",
        seed=3,
        observer=0,
        is_broadcast=is_broadcast,
        full_scale=10.0,
    )
    return Footage(
        facts=facts,
        window=np.arange(1, num + 1),
        position_m=np.zeros((num, 2, 2)),
        velocity_mps=np.zeros((num, 2, 2)),
        age=np.zeros((num, 2)),
        is_on=np.ones((num, 2), dtype=bool),
        segments={},
        age_mean=np.array(age_mean, dtype=float),
        is_cut_off=np.zeros((num, 2), dtype=bool),
    )


def has(picture, colour, tolerance=6):
    return np.abs(np.asarray(picture).astype(int) - colour).max(axis=2) <= tolerance


def test_a_constant_age_is_a_line_at_its_height():
    """10 of an axis to 10 is on top, 0 at the bottom."""
    heights = []
    for age in (10.0, 5.0, 0.001):
        picture = blank(400, 160)
        plot = AgePlot([footage([age] * 5 + [10.0])], BOX, 10)
        plot.draw_until(ImageDraw.Draw(picture), [4])
        rows, _ = np.nonzero(has(picture, palette.MEAN_AGE, 40))
        heights.append(np.median(rows))
    top, middle, bottom = heights
    assert top < middle < bottom
    np.testing.assert_allclose(middle, (top + bottom) / 2, atol=2)


def test_the_legend_names_what_is_drawn_only():
    samples = {}
    for is_broadcast in (True, False):
        picture = blank(400, 160)
        seen = footage([1.0], is_broadcast=is_broadcast)
        draw_legend(ImageDraw.Draw(picture), [seen], 10.0, BOX, 12)
        samples[is_broadcast] = picture
        assert np.any(has(picture, palette.UNKNOWN))
        assert np.any(has(picture, (253, 231, 37)))  # the ramp's fresh end
    assert np.any(has(samples[False], palette.LOST))
    assert not np.any(has(samples[True], palette.LOST))


def with_one_too_weak(seen):
    """The same footage, in which robot 1 is cut off from robot 0 as their link is too weak."""
    number = np.zeros(1, dtype=np.int16)
    link = LinkMismatch(
        window=np.array([1]),
        row=np.zeros(1, dtype=int),
        sender=number,
        receiver=number + 1,
        is_too_weak=np.ones(1, dtype=bool),
        loss_db=number + 99,
        margin_db=number - 11,
    )
    is_cut_off = np.tile([False, True], (len(seen.window), 1))
    return replace(seen, mismatch=link, is_cut_off=is_cut_off)


def test_the_legend_names_links_that_surprise_if_there_are_any():
    found = []
    for seen in (footage([1.0]), with_one_too_weak(footage([1.0]))):
        picture = blank(400, 160)
        draw_legend(ImageDraw.Draw(picture), [seen], 10.0, BOX, 12)
        colours = (palette.MISMATCH["too_weak"], palette.CUT_OFF, palette.MISMATCH["unbelieved"])
        found.append([bool(np.any(has(picture, colour, 0))) for colour in colours])
    assert found == [[False] * 3, [True, True, False]]


def test_the_plot_has_columns_for_who_is_cut_off():
    """Robot 0 is cut off from the only other one: all of the plot's height."""
    red = palette.dim(palette.CUT_OFF, SHADE)
    heights = []
    for seen in (footage([10.0] * 5), with_one_too_weak(footage([10.0] * 5))):
        picture = blank(400, 160)
        AgePlot([seen], BOX, 10).draw_axes(ImageDraw.Draw(picture))
        heights.append(np.sum(np.any(has(picture, red, 0), axis=1)))
    none, whole = heights
    assert none == 0
    inner = BOX.height - 10 - 14
    assert abs(whole - inner) <= 2


def said(robots, others):
    """Where red texts are after shortfalls were drawn: rows and columns."""
    picture = blank(400, 160)
    margin_db = -np.arange(3, 3 + len(others), dtype=np.int16)
    numbers = np.array(others, dtype=np.int16), margin_db
    draw_shortfalls(ImageDraw.Draw(picture), np.array(robots), *numbers, 12)
    return np.nonzero(has(picture, palette.TOO_WEAK, 60))


def test_a_shortfall_is_said_beside_the_robot_at_the_far_end():
    rows, columns = said([[300.0, 90.0], [50.0, 50.0]], [1])
    assert 55 < columns.min() <= columns.max() < 100
    assert abs(np.mean(rows) - 50.0) < 3.0


def test_a_shortfall_covers_no_other_robot_if_it_can():
    rows, columns = said([[300.0, 90.0], [150.0, 50.0], [175.0, 50.0]], [1])
    assert columns.max() < 145
    assert abs(np.mean(rows) - 50.0) < 3.0


def test_shortfalls_do_not_cover_each_other():
    """Around one place there is room for four, and what more there is is left out."""
    four, eight = (len(said([[200.0, 80.0]] * num, range(num))[0]) for num in (4, 8))
    assert four == eight > 0


def test_a_shortfall_stands_on_dark_ground():
    picture = blank(400, 160)
    draw = ImageDraw.Draw(picture)
    draw.rectangle((0, 0, 400, 160), (255, 255, 255))
    one = np.array([0], dtype=np.int16)
    draw_shortfalls(draw, np.array([[200.0, 80.0]]), one, one - 9, 12)
    rows, columns = np.nonzero(has(picture, palette.TOO_WEAK, 60))
    around = np.asarray(picture)[rows.min() - 1, columns.min() : columns.max()]
    assert np.all(around == palette.BACKGROUND)


def test_the_title_counts_who_is_cut_off():
    is_red = []
    for seen in (footage([1.0]), with_one_too_weak(footage([1.0]))):
        picture = blank(400, 160)
        draw_title(ImageDraw.Draw(picture), seen, 0, Box(0, 0, 400, 160), 12, (0, 255, 0))
        is_red.append(bool(np.any(has(picture, palette.TOO_WEAK, 20))))
    assert is_red == [False, True]


def test_the_title_stays_in_its_part_of_the_picture():
    picture = blank(400, 160)
    draw_title(
        ImageDraw.Draw(picture), footage([1.0, 2.0]), 1, Box(100, 0, 400, 160), 12, (255, 0, 0)
    )
    pixels = np.asarray(picture)
    assert np.all(pixels[:, :100] == palette.BACKGROUND)
    assert np.any(has(picture, palette.TEXT))
    assert np.any(has(picture, (255, 0, 0)))


def test_a_title_has_a_line_for_each_part_of_ones_own():
    lowest = []
    for parts in ({}, {"channel": "my:Radio"}, {"channel": "my:Radio", "scene": "my:walls"}):
        picture, seen = blank(400, 160), footage([1.0])
        seen = replace(seen, facts=replace(seen.facts, **parts))
        draw_title(ImageDraw.Draw(picture), seen, 0, Box(0, 0, 400, 160), 12, (255, 0, 0))
        rows, _ = np.nonzero(~has(picture, palette.BACKGROUND))
        lowest.append(rows.max())
    assert np.all(np.diff(lowest) >= 8)
