"""What a rule proposes, and what it lets robots believe of each other."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int, Int16

FARTHEST = 40  # nobody is told of a transmission that is later [slots]


class Proposal(NamedTuple):
    """Of one slot: `[b, i, j]` is what robot i of mission b believes of j, or says of itself."""

    is_due: Bool[np.ndarray, "B N N"]  # whether j transmits in the slot
    due_in: Int16[np.ndarray, "B N N"]  # in how many slots it does so next
    is_agreed: Bool[
        np.ndarray, "B N"
    ]  # whether the schedule is in force, or the turns of the start

    @property
    def transmits(self) -> Bool[np.ndarray, "B N"]:
        """Who should transmit, by the rule."""
        return np.diagonal(self.is_due, axis1=1, axis2=2)


def turns(
    order: Int[np.ndarray, "B N"], slot: Int[np.ndarray, "B"]
) -> tuple[Bool[np.ndarray, "B N N"], Int16[np.ndarray, "B N N"]]:
    """Whose turn it is in a common order, and when everyone's is next.

    Args:
        order: The robot at each place.
        slot: Of each mission.

    Returns:
        As a proposal's first two parts.
    """
    num_robots = order.shape[1]
    place = np.argsort(order, axis=1)
    due_in = 1 + (place - slot[:, None] - 1) % num_robots
    shape = (*order.shape, num_robots)
    is_due = np.broadcast_to((due_in == num_robots)[:, None, :], shape)
    return is_due.copy(), np.broadcast_to(due_in.astype(np.int16)[:, None, :], shape).copy()
