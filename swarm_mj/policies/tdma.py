"""Time-division multiple access: one robot broadcasts after the other, or several far apart.

For the second see Nelson and Kleinrock 1985; by interference, Grönkvist and Hansson 2001.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission import Mission
from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.mission_radio import Belief
from swarm_mj.radio.power_law import PowerLaw, no_powers
from swarm_mj.radio.spatial_reuse import keep_joined
from swarm_mj.system.decibels import from_db


class Tdma(BroadcastPolicy):
    """Robots take turns, in a fixed random order.

    Time-division multiple access (Miao, Zander, Sung, Slimane: Fundamentals of Mobile Data
    Networks, 2016). Nobody interferes, so every robot in range decodes. The order is drawn for each
    mission and, like the identities, granted to all of its robots beforehand (II-C).
    """

    uses = "its identity, a common random order and the clock: one robot transmits per slot"

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draw every mission's order; arguments as in `Policy.start`."""
        self._order = draw_order(num_robots, rngs)

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return the one robot whose slot it is."""
        place = slot_of(views.now) % views.num_robots
        owner = self._order[np.arange(len(place)), place]
        return views.silence == owner[:, None]


class SpatialTdma(Tdma):
    """TDMA where robots that are far apart share a slot.

    Who joins the owner of the turn is the rule of `radio.spatial_reuse`: each robot predicts from
    its own buffer, alone, which packets its teammates would decode, and robots that believe the
    same decide the same. Until a robot has heard of everyone it transmits in its own turn only: so
    the team begins as `Tdma` does, and no robot that joins overlooks a listener of the owner's.
    """

    uses = "as tdma, and the positions in its buffer: robots far enough apart share a slot"

    def __init__(self, mission: Mission) -> None:
        """Prepare the policy for the mission's radio, in free space unless informed otherwise."""
        self._range_m, self._threshold = mission.range_m, from_db(mission.sinr_threshold_db)
        self._law: PowerLaw | None = None  # of mean powers [noise]

    def inform(self, belief: Belief) -> None:
        """Take the powers that robots believe in."""
        law, noise_mw = belief.law, belief.radio.noise_mw
        self._law = None if law is None else law._replace(at_1_m=law.at_1_m / noise_mw)

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draw every mission's order, and forget powers; arguments as in `Policy.start`."""
        super().start(num_robots, rngs)
        self._powers = None if self._law is None else no_powers(self._law, len(rngs))

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return each robot whose turn it is or that may join."""
        is_oneself = np.eye(views.num_robots, dtype=np.bool_)
        is_sending = np.all(views.buffers.is_known | is_oneself, axis=2)
        keep_joined(
            views.buffers.position_m,
            self._order,
            slot_of(views.now),
            self._range_m,
            self._threshold,
            is_sending,
            self._powers,
        )
        return is_sending


def draw_order(num_robots: int, rngs: Sequence[np.random.Generator]) -> Int[np.ndarray, "B N"]:
    """Return a random order for each mission: the robot at each place of it."""
    return np.stack([rng.permutation(num_robots) for rng in rngs])


def slot_of(now: Float[np.ndarray, "B"]) -> Int[np.ndarray, "B"]:
    """Return the slot that begins now, counted from 0 at the mission's start."""
    return np.rint(now / SLOT_WINDOWS).astype(np.int64)
