"""Messages that refuse arguments."""

import pytest

from swarm_mj.system.arguments import did_you_mean


@pytest.mark.parametrize(
    ("typed", "meant"),
    [("windows", "num_windows"), ("robots", "num_robots"), ("num_robot", "num_robots")],
)
def test_the_name_that_was_meant_holds_the_word_or_is_like_it(typed, meant):
    known = ["window_s", "num_windows", "num_robots", "noise_dbm"]
    assert did_you_mean(typed, known) == f"; did you mean {meant}?"
