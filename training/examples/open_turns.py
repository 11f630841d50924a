"""`index-csma` whose turns are open: others may transmit in them, too, unless they miss someone.

    swarm-mj fly --policy training.examples.open_turns:OpenTurns --task flocking

In a turn of `index-csma` its owner does not listen, and all others are silent. That joins teams
again whose parts hang together by one long link, which bears no second transmitter nearby. All
other teams lose a slot in five by it. Here a robot is silent in a turn only if someone in the team
is lost to it: if the oldest entry of its buffer is older than the team has robots. Otherwise it
contends after the owner, and for a quieter channel than usual. `training/RESULTS.md` has the ages.
"""

import numpy as np

from swarm_mj.mission import Mission
from swarm_mj.policies.carrier_sense import in_turn
from swarm_mj.policies.index.policy import IndexCsma
from swarm_mj.policies.index.shipped import shipped_weights
from swarm_mj.policies.tdma import slot_of
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.carrier_sensing import Contention

# Chosen by walks and flocks of 40 robots, seeds 8500 to 8529.
TURN_EVERY = 4  # slots, of which the last is a turn
QUIETER_DB = 3.0  # than usual: how quiet the channel of a robot that joins a turn must be
LOST_AFTER = 1.0  # windows for each robot of the team: someone not heard of for longer is lost


class OpenTurns(IndexCsma):
    """The shipped index, with turns that are closed only to robots that miss someone."""

    uses = "as index-csma"

    def __init__(self, mission: Mission) -> None:
        """Prepare the policy for the mission's radio."""
        super().__init__(mission, shipped_weights())

    def contend(self, views: LocalViews) -> Contention:
        """Return the contention by the index; in turns, the owner's, and of those who join it."""
        slot = int(slot_of(views.now)[0])  # the clocks of all missions are alike
        contention = self._by_index(views, slot)
        turn, place = divmod(slot, TURN_EVERY)
        if place < TURN_EVERY - 1:
            return contention
        closed = in_turn(views, turn)
        is_owner = np.isfinite(closed.minislot)
        age_windows = views.now[:, None, None] - views.buffers.timestamp
        misses_someone = np.max(age_windows, axis=2) > LOST_AFTER * views.num_robots
        joins = ~is_owner & ~misses_someone
        # The owner begins in the first minislot, so that others sense it in the next.
        minislot = np.where(joins, np.maximum(contention.minislot, 1.0), closed.minislot)
        busy_dbm = np.where(joins, contention.busy_dbm - QUIETER_DB, closed.busy_dbm)
        return Contention(minislot, busy_dbm)
