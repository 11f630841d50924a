"""Messages that refuse arguments."""

import pytest

from swarm_mj.system.arguments import check_component, did_you_mean


@pytest.mark.parametrize(
    ("typed", "meant"),
    [("windows", "num_windows"), ("robots", "num_robots"), ("num_robot", "num_robots")],
)
def test_the_name_that_was_meant_holds_the_word_or_is_like_it(typed, meant):
    known = ["window_s", "num_windows", "num_robots", "noise_dbm"]
    assert did_you_mean(typed, known) == f"; did you mean {meant}?"


class Starting:
    """A component whose `start` takes a team's size alone."""

    def __call__(self, states):
        return states

    def start(self, num_robots):
        self.num_robots = num_robots


def test_a_component_that_cannot_be_started_is_refused_before_it_flies():
    said = r"a pilot's start is called with \(num_robots, rngs\), but this one takes \(num_robots\)"
    with pytest.raises(TypeError, match=said):
        check_component("pilot", Starting(), ("states",))
    starting = Starting()
    starting.start = None  # it says that it needs no start
    check_component("pilot", starting, ("states",))
