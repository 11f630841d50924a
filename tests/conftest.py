"""What the tests of several modules share."""

import numpy as np
import pytest
from hypothesis import settings

# Compiling takes its time on an example's first run; no law here is about time.
settings.register_profile("swarm_mj", deadline=None, max_examples=50)
settings.load_profile("swarm_mj")


@pytest.fixture
def deaf_channel():
    """A channel over which nobody decodes anything: a robot that hears itself heard nobody."""

    def nobody_hears(position_m, recipient):  # noqa: ARG001 - a Channel
        return np.broadcast_to(np.arange(recipient.shape[1]), recipient.shape).copy()

    return nobody_hears
