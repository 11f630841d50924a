"""The rule of teams at rest: one plan from positions and the clock (`planner/plan.py`)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int, Int16

from swarm_mj.policies.planner.plan import Plan
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.tdma import draw_order, slot_of
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.mission_radio import Belief

MOST_PLANS = 512  # that are kept for positions that come again
FARTHEST = 40  # later transmissions count as this far ahead [slots]


class Proposal(NamedTuple):
    """The rule's proposal for a slot: `[b, i, j]` is what robot i of mission b believes of j."""

    is_due: Bool[np.ndarray, "B N N"]  # whether j transmits in the slot
    due_in: Int16[np.ndarray, "B N N"]  # in how many slots it does so next
    is_agreed: Bool[
        np.ndarray, "B N"
    ]  # whether the schedule is in force, or the turns of the start

    @property
    def transmits(self) -> Bool[np.ndarray, "B N"]:
        """Return which robots should transmit, by the rule."""
        return np.diagonal(self.is_due, axis1=1, axis2=2)


def turns(
    order: Int[np.ndarray, "B N"], slot: Int[np.ndarray, "B"]
) -> tuple[Bool[np.ndarray, "B N N"], Int16[np.ndarray, "B N N"]]:
    """Return whose turn it is in a common order, and when each robot's is next.

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


class RestingRule:
    """A rule: robots that have heard of all others follow one common plan; others take turns.

    It is `planner --payload none` in a team at rest. Plans are kept for positions that come again.
    """

    uses = (
        "its buffer, T in packets, a common order, the clock and the radio: it follows the plan of "
        "planner --payload none"
    )

    def __init__(self, radio: FreeSpaceRadio) -> None:
        """Prepare the rule; robots believe in the radio unless it is informed otherwise."""
        self._belief = Belief(radio=radio)
        self._plans: dict[bytes, Plan] = {}

    def inform(self, belief: Belief) -> None:
        """Plan by this belief from now on."""
        are_plain = _is_free_space(belief) and _is_free_space(self._belief)
        if not (are_plain and belief.radio == self._belief.radio):
            self._plans = {}
        self._belief = belief

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draw each mission's order of turns; arguments as in `Policy.start`."""
        self._order = draw_order(num_robots, rngs)
        if len(self._plans) > MOST_PLANS:
            self._plans = {}

    def propose(self, views: LocalViews) -> Proposal:
        """Return the plan's choice, or the turns'."""
        buffers, slot = views.buffers, slot_of(views.now)
        knows_motion = np.any(buffers.velocity_mps, axis=(2, 3))
        knows_all = np.all(buffers.is_known, axis=2) & ~knows_motion
        is_due, due_in = turns(self._order, slot)
        for b in np.flatnonzero(np.any(knows_all, axis=1)).tolist():
            # Robots at rest believe the same positions as soon as they know them all.
            members: dict[bytes, list[int]] = {}
            for i in np.flatnonzero(knows_all[b]).tolist():
                members.setdefault(buffers.position_m[b, i].tobytes(), []).append(i)
            for key, robots in members.items():
                if key not in self._plans:
                    links = self._belief.links(buffers.position_m[b, robots[0]])
                    self._plans[key] = Plan(links, PlannerSettings())
                is_due[b, robots], due_in[b, robots] = _ahead(self._plans[key], int(slot[b]))
        return Proposal(is_due, due_in, knows_all)


def _ahead(plan: Plan, slot: int) -> tuple[Bool[np.ndarray, "N"], Int16[np.ndarray, "N"]]:
    """Return which robots transmit by the plan, and in how many slots they next do."""
    ahead = np.stack([plan.transmits(slot + n) for n in range(1 + FARTHEST)])
    later = ahead[1:]
    due_in = np.where(np.any(later, axis=0), 1 + np.argmax(later, axis=0), len(ahead))
    return ahead[0], due_in.astype(np.int16)


def _is_free_space(belief: Belief) -> bool:
    """Return whether nothing is believed of the channel but its radio."""
    return belief.law is None and belief.reception is None and belief.shadowing_db == 0.0
