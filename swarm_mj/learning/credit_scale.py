"""The scale of credits: what they usually are in one kind of mission.

A packet is worth several times as much in a team of 10, as a mean over pairs, as in one of 40.
Trained together, the small teams would teach most of what the network learns.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

KEPT = 0.999  # weight of each window in the mean, against the next one


@dataclass
class CreditScale:
    """The root mean square of the credits of one kind of mission, of late.

    Credits of 0 do not count: almost all of them are of robots that were silent.
    """

    total: float = 0.0  # of the squares, weighted
    count: float = 0.0  # of the credits, weighted alike

    def divided(self, credit: Float32[np.ndarray, "E"]) -> Float32[np.ndarray, "E"]:
        """Take in a window's credits; return them by the scale, which is then of them as well."""
        counted = credit[credit != 0.0].astype(np.float64)
        self.total = KEPT * self.total + float(np.sum(counted**2))
        self.count = KEPT * self.count + len(counted)
        if self.total == 0.0:
            return credit
        return (credit / math.sqrt(self.total / self.count)).astype(np.float32)
