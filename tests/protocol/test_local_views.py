"""A view is live, cannot be written, and knows the team's size and what silence is."""

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.simulation.swarm import Swarm


def views_of(num_missions, num_robots):
    buffers = empty_buffers(num_missions, num_robots)
    return LocalViews(buffers=buffers, now=np.zeros(num_missions), phases=())


@pytest.mark.parametrize(("num_missions", "num_robots"), [(2, 8), (3, 8), (2, 5)])
def test_alg1_silence_is_addressing_oneself(num_missions, num_robots):
    views = views_of(num_missions, num_robots)
    assert views.num_robots == num_robots
    np.testing.assert_array_equal(views.silence, [range(num_robots)] * num_missions)


def test_silence_cannot_be_written():
    """All views of a shape share it, so a policy that wrote it would silence or wake others."""
    with pytest.raises(ValueError, match="read-only"):
        views_of(2, 3).silence[0, 1] = 0
    np.testing.assert_array_equal(views_of(2, 3).silence, [[0, 1, 2]] * 2)


def test_a_swarms_view_changes_with_the_next_window_and_not_by_hand():
    swarm = Swarm(paper("stationary", num_robots=3), [1])
    views = swarm.views
    swarm.step_with_recipients(views.silence)
    np.testing.assert_array_equal(np.diagonal(views.buffers.timestamp[0]), [1.0, 1.0, 1.0])
    with pytest.raises(ValueError, match="read-only"):
        views.buffers.timestamp[0, 0, 1] = 9.0
