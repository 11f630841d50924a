"""The chart of a check shows its numbers."""

import numpy as np

from swarm_mj.evaluation.convergence import Convergence, Goal
from swarm_mj.mission import paper


def test_missions_step_up_to_the_share_that_converged_beside_the_claim():
    found = Convergence(
        mission=paper("flocking", num_windows=100),
        policy="tdma",
        config={"version": "1.2", "commit": None},
        goal=Goal(within_s=4.0, share=0.6),
        cost="under 1% of the first velocity variance",
        seed=1,
        window=np.array([30.0, np.nan, 20.0, 50.0]),
    )
    figure = found.plot()
    (axes,) = figure.axes
    course, within, share = axes.lines
    np.testing.assert_allclose(course.get_xdata(), [0.0, 2.0, 3.0, 5.0, 10.0])
    np.testing.assert_allclose(course.get_ydata(), [0.0, 0.25, 0.5, 0.75, 0.75])
    assert set(within.get_xdata()) == {4.0}
    assert set(share.get_ydata()) == {0.6}
    (interval,) = axes.collections
    ends = interval.get_segments()[0]
    np.testing.assert_allclose(ends, [(4.0, found.interval.low), (4.0, found.interval.high)])
    assert "not decided" in figure.get_suptitle()
