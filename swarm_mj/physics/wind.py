"""The wind around robots with bodies: a mean to the east, and gusts."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Stream, correlated, normal
from swarm_mj.mission.geometry import PLANE


class Wind:
    """The wind of B missions, from window to window.

    Gusts are a first-order Gauss-Markov process of constant variance, per axis of the plane; those
    of mission b come from its own generator alone.

    Args:
        mission: Its mean, how strong gusts are [m/s], and how long they last [s].
        wind_mps: MuJoCo's own numbers, [B 3], which are written here.
    """

    def __init__(self, mission: Mission, wind_mps: Float[np.ndarray, "B 3"]) -> None:
        self._mission = mission
        self._wind_mps = wind_mps
        self._kept = np.exp(-mission.window_s / mission.gust_s)  # of a gust, a window later
        self._gusts: Stream | None = None
        self._gust_mps = np.zeros((len(wind_mps), PLANE))

    def start(self, rngs: Sequence[np.random.Generator]) -> None:
        """Draw the first gusts, and blow."""
        self._gust_mps = np.zeros((len(rngs), PLANE))
        if self._mission.gust_mps > 0.0:
            self._gusts = Stream(rngs, normal, (PLANE,))
            self._gust_mps = self._mission.gust_mps * self._gusts.next()
        self._blow()

    def change(self) -> None:
        """Let gusts change by a window."""
        if self._gusts is not None:
            fresh_mps = self._mission.gust_mps * self._gusts.next()
            self._gust_mps = correlated(self._gust_mps, fresh_mps, self._kept)
        self._blow()

    @property
    def now_mps(self) -> Float[np.ndarray, "B 2"]:
        """The wind in each mission, in an array of its own [m/s]."""
        return self._wind_mps[:, :PLANE].copy()

    def _blow(self) -> None:
        self._wind_mps[:, 0] = self._mission.wind_mps + self._gust_mps[:, 0]
        self._wind_mps[:, 1] = self._gust_mps[:, 1]
