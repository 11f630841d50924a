import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm_mj.control.voronoi import cell, moments

HALF = 50.0


def grid(half, num):
    """Centres of num x num squares that tile the area."""
    x = (np.arange(num) + 0.5) * (2 * half / num) - half
    return np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)


def everyone(position_m):
    return np.ones(len(position_m), dtype=np.bool_)


def corners_of(polygon):
    return sorted({(round(x, 9), round(y, 9)) for x, y in polygon})


def test_a_robot_alone_has_the_area():
    alone = np.array([[10.0, 20.0]])
    polygon = cell(alone, everyone(alone), 0, HALF)
    assert corners_of(polygon) == [(-50, -50), (-50, 50), (50, -50), (50, 50)]


def test_two_robots_share_by_the_bisector():
    """At x = -20 and x = 40 the border is x = 10: 60 m and 40 m of 100 m each."""
    pair = np.array([[-20.0, 0.0], [40.0, 0.0]])
    west, east = (cell(pair, everyone(pair), i, HALF) for i in range(2))
    assert corners_of(west) == [(-50, -50), (-50, 50), (10, -50), (10, 50)]
    assert corners_of(east) == [(10, -50), (10, 50), (50, -50), (50, 50)]


def test_a_border_through_the_areas_corners_keeps_them():
    pair = np.array([[-1.0, 1.0], [1.0, -1.0]])
    north_west = cell(pair, everyone(pair), 0, HALF)
    assert corners_of(north_west) == [(-50, -50), (-50, 50), (50, 50)]


def test_of_robots_at_one_point_the_first_takes_all():
    pair = np.array([[1.0, 1.0], [1.0, 1.0]])
    assert len(cell(pair, everyone(pair), 0, HALF)) == 4
    assert len(cell(pair, everyone(pair), 1, HALF)) == 0


def test_who_does_not_count_takes_nothing():
    three = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0]])
    polygon = cell(three, np.array([True, False, False]), 0, HALF)
    assert moments(polygon, three[0])[0] == pytest.approx(1e4)


@given(seed=st.integers(0, 2**32 - 1), num_robots=st.integers(2, 12))
def test_cells_hold_the_points_that_are_nearer_to_their_robot_than_to_others(seed, num_robots):
    """By brute force: the nearest robot of every point of a fine grid, robots outside included."""
    position_m = np.random.default_rng(seed).uniform(-1.3 * HALF, 1.3 * HALF, (num_robots, 2))
    points = grid(HALF, 100)
    apart_m2 = np.sum((points[:, None] - position_m) ** 2, axis=2)
    nearest = np.argmin(apart_m2, axis=1)
    for i in range(num_robots):
        area, first_x, first_y, second = moments(
            cell(position_m, everyone(position_m), i, HALF), position_m[i]
        )
        own = points[nearest == i] - position_m[i]
        border = 4 * 2 * HALF  # a square of 1 m² that a border cuts is given to one robot whole
        assert area == pytest.approx(len(own), abs=border)
        scale = 3 * HALF
        assert [first_x, first_y] == pytest.approx(own.sum(axis=0).tolist(), abs=border * scale)
        assert second == pytest.approx(np.sum(own**2), abs=border * scale**2)


def test_cells_tile_the_area():
    position_m = np.random.default_rng(3).uniform(-HALF, HALF, (30, 2))
    areas = [
        moments(cell(position_m, everyone(position_m), i, HALF), position_m[i])[0]
        for i in range(30)
    ]
    assert sum(areas) == pytest.approx(1e4, rel=1e-12)


def test_moments_of_a_rectangle_by_hand():
    """2 m by 4 m from (0, 0), about (0, 0): A 8; A x 8, A y 16; 8 (2² + 4²) / 3."""
    rectangle = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 4.0], [0.0, 4.0]])
    assert moments(rectangle, np.zeros(2)) == pytest.approx((8.0, 8.0, 16.0, 160.0 / 3.0))
