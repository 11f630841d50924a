"""Who has more power, and when clocks differ, by hand."""

import pytest

from swarm_mj.mission import paper


@pytest.mark.parametrize(
    ("fraction", "extra_db", "num"),
    [
        (0.0, 6.0, 0),
        (0.25, 6.0, 3),
        (0.04, 6.0, 0),  # 0.48 robots
        (0.05, 6.0, 1),  # 0.6
        (1.0, 6.0, 12),
        (1.0, 0.0, 0),  # without extra power nobody has more
    ],
)
def test_a_fraction_is_of_the_team_to_the_nearest(fraction, extra_db, num):
    mission = paper(num_robots=12, high_power_fraction=fraction, high_power_db=extra_db)
    assert mission.num_high_power == num


@pytest.mark.parametrize(
    ("offset_s", "drift_ppm", "differ"), [(0.0, 0.0, False), (0.01, 0.0, True), (0.0, 5.0, True)]
)
def test_clocks_differ_by_their_offset_or_by_their_drift(offset_s, drift_ppm, differ):
    mission = paper(clock_offset_s=offset_s, clock_drift_ppm=drift_ppm)
    assert mission.clocks_differ is differ
