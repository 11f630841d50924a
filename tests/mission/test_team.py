"""The team's area and ratios by hand arithmetic."""

import pytest

from swarm_mj.mission import paper


@pytest.mark.parametrize(
    ("num_robots", "density", "side_m"),
    # 10 robots need a quarter of 1 km², 90 at 10 per km² need 9 km², 2 need 1/20 km².
    [(10, 40.0, 500.0), (90, 10.0, 3000.0), (160, 40.0, 2000.0), (2, 40.0, 223.60679775)],
)
def test_the_area_keeps_the_density(num_robots, density, side_m):
    mission = paper(num_robots=num_robots, density_per_km2=density)
    assert mission.side_m == pytest.approx(side_m)
    assert mission.half_side_m == pytest.approx(side_m / 2)


def test_ratios_mean_one_kilometre_whatever_the_team():
    small = paper(num_robots=10, range_ratio=0.2, velocity_ratio=0.5, num_windows=7, window_s=0.2)
    assert small.range_m == pytest.approx(200.0)
    assert small.max_velocity_mps == pytest.approx(10.0)  # 500 m in 50 s
