"""The map's frame, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from swarm_mj.replay.frame import frame


def moved(log, *, by_m):
    """The log with a team that drifts, so much in all."""
    drift = np.linspace(0.0, 1.0, len(log.window))[:, None, None] * np.array(by_m)
    return replace(log, position_m=log.position_m + drift)


def test_a_team_that_stays_is_shown_with_the_area(two_way):
    half_side_m = two_way.mission.half_side_m
    assert np.max(np.abs(two_way.log.position_m)) <= half_side_m  # the boundary reflects
    shown = frame(two_way.log.position_m, half_side_m)
    assert shown.reach_m == half_side_m
    assert not shown.moves


def test_a_team_that_leaves_the_area_a_little_is_shown_with_it(two_way):
    log = moved(two_way.log, by_m=(0.0, 100.0))
    shown = frame(log.position_m, two_way.mission.half_side_m)
    assert shown.reach_m == np.max(np.abs(log.position_m)) > two_way.mission.half_side_m
    assert not shown.moves


@pytest.mark.parametrize(("farthest_m", "moves"), [(150.0, False), (150.1, True)])
def test_a_team_within_one_and_a_half_times_the_area_is_shown_with_it(two_way, farthest_m, moves):
    """An area of half side 100 m; one robot stands as far out, in one window."""
    position_m = np.zeros_like(two_way.log.position_m)
    position_m[3, 5, 1] = -farthest_m
    shown = frame(position_m, 100.0)
    assert shown.moves == moves


def test_a_team_that_flies_off_is_followed(two_way):
    log = moved(two_way.log, by_m=(9000.0, -500.0))
    shown = frame(log.position_m, two_way.mission.half_side_m)
    assert shown.moves
    for here, centre in zip(log.position_m, shown.centre_m, strict=True):
        assert np.max(np.abs(here - centre)) <= shown.reach_m + 1e-6
    assert shown.reach_m == pytest.approx(
        max(np.ptp(here, axis=0).max() for here in log.position_m) / 2
    )
