"""The size of replays by hand: a fit of three robots for two windows, and where it is cut off."""

import pytest

from swarm_mj.mission import paper
from swarm_mj.replay.replay_size import ReplaySize, in_matrix

FIT = ReplaySize(
    base=1000.0, window=100.0, robot=10.0, matrix=2.0, bodies=500.0, body=50.0, pose=5.0
)


def test_a_replay_has_a_base_windows_robots_and_matrices():
    """Of 3 robots, a matrix of float32 has 4 x 9 bytes; two windows have two."""
    assert FIT.of(paper(num_robots=3), 2) == 1000.0 + 2 * (100.0 + 3 * 10.0) + 2.0 * 2 * 36


def test_bodies_take_more_once_and_in_each_window():
    flat = FIT.of(paper(num_robots=3), 2)
    more = FIT.of(paper(num_robots=3, robot="rover"), 2) - flat
    assert more == 500.0 + 3 * 50.0 + 2 * 3 * 5.0


def test_matrices_take_no_more_than_their_limit():
    """200 robots' matrices reach 64 MB after 400 windows; later windows cost 2100 bytes each."""
    mission = paper(num_robots=200)
    assert FIT.of(mission, 401) - FIT.of(mission, 400) == pytest.approx(2100.0)
    assert FIT.of(mission, 400) - FIT.of(mission, 399) == pytest.approx(2100.0 + 2.0 * 160e3)


@pytest.mark.parametrize(
    ("num_robots", "num_shown", "stride"), [(3, 3, 1), (1000, 1000, 1), (1001, 501, 2)]
)
def test_the_matrix_shows_every_kth_robot_of_large_teams(num_robots, num_shown, stride):
    shown = in_matrix(num_robots)
    assert (len(shown), shown.step) == (num_shown, stride)
