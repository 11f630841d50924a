"""The log of a flight, or of a piece of it: all that its replay shows, as plain arrays."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.protocol.buffers import NO_PARENT
from swarm_mj.protocol.costs import TaskCost
from swarm_mj.replay import links
from swarm_mj.replay.footage import Footage

LEAD_WINDOWS = 150  # that a piece of a flight knows of what was before it
# The slots of a window of Alg. 1, in arrays of both.
REQUEST = 0
RESPONSE = 1


class Lead(NamedTuple):
    """The last windows before a piece of a flight: what trails and counts reach back to."""

    position_m: Float[np.ndarray, "P N 2"]
    recipient: Int[np.ndarray, "P 2 N"]
    heard: Int[np.ndarray, "P 2 N"]


@dataclass(frozen=True, kw_only=True)
class Log(Footage):
    """Footage and all else that a replay shows of a flight, or of a piece, as it was recorded."""

    lead: Lead  # of at most `LEAD_WINDOWS`; none before a whole flight
    recipient: Int[np.ndarray, "T 2 N"]  # S^i in both phases; itself: silent
    heard: Int[np.ndarray, "T 2 N"]  # the sender that robot j decoded in both phases; itself: none
    believed_m: Float[np.ndarray, "T N 2"]  # M: where j was, as the ego robot knows it [m]
    parent: Int[np.ndarray, "T N"]  # P^{ego,j}
    ego_age: Float[np.ndarray, "T N"]  # t - T^{ego,j}, also of those never heard of [windows]
    age_window: Int[np.ndarray, "K"]  # the windows of the age matrix, every stride-th
    age: Float[np.ndarray, "K M M"]  # t - T^{i,j} of the robots `in_matrix` [windows]
    age_std: Float[np.ndarray, "T"]  # over all pairs of different robots that are on [windows]
    age_max: Float[np.ndarray, "T"]  # the worst pair's [windows]
    velocity_variance_m2ps2: Float[np.ndarray, "T"]
    # Of bodies' motors, by their weight and in their own axes [1]; None: points.
    thrust: Float[np.ndarray, "T N 3"] | None = None
    wind_mps: Float[np.ndarray, "T 2"] | None = None  # None: calm
    task_cost: TaskCost | None = None  # one value a window; None if the controller has none
    num_believed: Int[np.ndarray, "C"]  # links that policies believe in, in each snapshot
    num_working: Int[np.ndarray, "C"]  # links whose packets decode but for fades, likewise

    @property
    def is_transmitter(self) -> Bool[np.ndarray, "T N"]:
        """True if a robot sent a request, or a broadcast in either phase."""
        num_phases = 2 if self.facts.is_broadcast else 1
        return np.any(links.is_other(self.recipient)[:, :num_phases], axis=1)

    @property
    def is_other_known(self) -> Bool[np.ndarray, "T N"]:
        """True if the ego robot has heard of j, which is not itself."""
        return ~np.isnan(self.known_age) & (np.arange(self.known_age.shape[1]) != self.ego)

    @property
    def has_parent(self) -> Bool[np.ndarray, "T N"]:
        """True if the ego robot's entry of j came over the radio."""
        return self.is_other_known & (self.parent != NO_PARENT)
