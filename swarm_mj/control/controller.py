"""What drives the robots: a controller, and what it may declare beside its accelerations.

Index order: `[b, i]` is robot `i` of mission `b`.
"""

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import Buffers


@runtime_checkable
class Controller(Protocol):
    """What the robots want in the next window, from what they have heard.

    One that draws or remembers is also `Started`: it gets the missions' own random streams.
    """

    def __call__(self, buffers: Buffers, states: RobotStates, /) -> Float[np.ndarray, "B N 2"]:
        """The accelerations u [m/s²]; row [b, i] may use buffer and body [b, i] only.

        Args:
            buffers: What each robot has heard; they cannot be written.
            states: The robots' own states.

        Returns:
            The accelerations; the physics clips them to plus or minus A_max.
        """
        ...
