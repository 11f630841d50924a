"""The knowledge of each robot (II-C, Eq. 9's argument): its own view, and nothing else."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.protocol.buffers import Buffers
from swarm_mj.protocol.window import Phase


@dataclass(frozen=True, kw_only=True)
class LocalViews:
    """The robots' knowledge, one view a robot: `[b, i]` in every array belongs to robot i alone.

    Identities are the index i, the team's size is N; both are granted before the mission (II-C).
    The buffers are live: they cannot be written, and change with the next window.
    """

    buffers: Buffers  # robot i's buffer is row [b, i]
    now: Float[np.ndarray, "B"]  # t on the synchronised clock [windows]
    phases: tuple[Phase, ...]  # of this window, or else the last: whom robot i addressed and heard

    def copy(self) -> "LocalViews":
        """Return the same for code that may write: new arrays, and the buffers, which none can."""
        phases = tuple(phase.copy() for phase in self.phases)
        return LocalViews(buffers=self.buffers, now=self.now.copy(), phases=phases)

    @property
    def num_robots(self) -> int:
        """N, known to everyone before the mission (II-C)."""
        return self.buffers.timestamp.shape[1]

    @property
    def silence(self) -> Int[np.ndarray, "B N"]:
        """The recipients that mean silence: everyone addresses itself."""
        return _oneself(self.buffers.shape)


@cache
def _oneself(shape: tuple[int, int]) -> Int[np.ndarray, "B N"]:
    """Return every robot's own identity."""
    return np.broadcast_to(np.arange(shape[1]), shape)
