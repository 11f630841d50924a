"""Self-localisation with errors, which the paper has not: it takes what robots observe as exact."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Stream, correlated, normal
from swarm_mj.physics.state import RobotStates


class Localisation:
    """The error of every robot's own position: normal, per axis, fading over a correlation time.

    It is a first-order Gauss-Markov process, sampled once a window. A robot that stands, with a
    velocity of exactly 0, knows by its odometry that it has not moved: its estimate stays.

    Args:
        mission: How large errors are [m], and how long they last [s].
        rngs: A generator for each mission; mission b's errors come from the b-th alone.
    """

    def __init__(self, mission: Mission, rngs: Sequence[np.random.Generator]) -> None:
        """Prepare the errors of missions that begin."""
        self._std_m = mission.position_noise_m
        self._kept = 0.0  # share of an error that is left a window later
        if mission.position_noise_s > 0.0:
            self._kept = math.exp(-mission.window_s / mission.position_noise_s)
        self._draws = Stream(rngs, normal, (mission.num_robots, mission.num_axes))
        self._error_m: np.ndarray | None = None

    def advance(self, states: RobotStates) -> RobotStates:
        """Return the states with what robots observe of their own positions, a window later."""
        error_m = self._std_m * self._draws.next()
        before_m = self._error_m
        if before_m is not None:
            walked_m = correlated(before_m, error_m, self._kept)
            moves = np.any(states.velocity_mps, axis=2, keepdims=True)
            error_m = np.where(moves, walked_m, before_m)
        self._error_m = error_m
        return replace(states, observed_m=self.own_m(states))

    def own_m(self, states: RobotStates) -> Float[np.ndarray, "B N D"]:
        """Return where robots observe themselves to be, with the errors of this moment [m]."""
        assert self._error_m is not None  # `advance` has drawn them
        return states.position_m + self._error_m
