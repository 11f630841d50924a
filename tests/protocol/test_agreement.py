"""When flocks have agreed, by hand."""

import numpy as np
import pytest

from swarm_mj.protocol.agreement import agreed_window


@pytest.mark.parametrize(
    ("variance", "expected"),
    [
        ([4.0, 1.0, 0.03, 0.02], 3.0),
        ([4.0, 0.04, 0.039], 3.0),  # under 1 %, not at it
        ([4.0, 0.03, 0.05, 0.03], 4.0),  # for good
        ([4.0, 0.03, 0.05], np.nan),  # not at the end
        ([4.0], np.nan),
        ([0.0, 0.0, 0.0], np.nan),  # robots at rest
    ],
)
def test_it_is_the_first_window_from_which_on_hardly_any_variance_is_left(variance, expected):
    """Counted from 1; the mission beside it, whose flock agreed at once, changes nothing."""
    flown = [np.array([each, 4.0 if n == 0 else 0.0]) for n, each in enumerate(variance)]
    found = agreed_window(flown)
    np.testing.assert_array_equal(found[0], expected)
    assert len(variance) == 1 or found[1] == 2.0


def test_windows_without_a_number_end_an_agreement():
    """A controller may lead robots beyond all numbers."""
    flown = [np.array([each]) for each in (4.0, 0.01, np.nan, 0.01)]
    np.testing.assert_array_equal(agreed_window(flown), [4.0])
