"""The lookahead oracle: a scheduler that knows all buffers and positions, and plans ahead.

A team could not fly it; it is the reference for how low the age of information can go. In every
slot it follows several first transmitters for some slots, by the planner's own scheduler
(`broadcast_scheduler`), and chooses the one that leaves the team youngest. The planner's robots
schedule from what they believe of the team. Here T and the links are the true ones of each slot, so
nothing is lost to beliefs that differ or are old.

It is not optimal: a branch has few slots, in which robots stand still, and the scheduler is greedy
within each. Over uncertain links packets decode with a probability, as in `greedy_oracle`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission import Mission
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.about import Bound, Information, Listed, Look, PairMemory
from swarm_mj.policies.planner.broadcast_scheduler import Problem, schedule_slot
from swarm_mj.policies.planner.plan import over_other_links, problem_of
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.policy import CentralisedPolicy, two_broadcasts
from swarm_mj.protocol.buffers import BROADCAST
from swarm_mj.protocol.timestamps import SLOTS_PER_WINDOW
from swarm_mj.protocol.window import LocalViews
from swarm_mj.protocol.window_protocols import DoubleBroadcast
from swarm_mj.radio.links import Links, among
from swarm_mj.radio.mission_radio import TrueLinks, radio_of

# Width and depth, as in `Problem`. Chosen on 12 walking missions and 12 at rest of 40 robots, from
# seed 7000: of those that take as long, it has the least age. (6, 6) takes twice the time, for 2 to
# 3 % less.
LOOKAHEAD = (3, 4)
# For so long weights are kept while robots move. They take a time that grows with N³; new ones
# every 4 windows gained nothing on the same missions.
WEIGHED_SLOTS = 20


@dataclass(frozen=True, kw_only=True)
class _Scene:
    """The problem of one mission's last slot, and all that tells whether it is still the same."""

    position_m: Float[np.ndarray, "N D"]  # of its links
    weighed_m: Float[np.ndarray, "N D"]  # where robots were when its weights were worked out [m]
    weighed: float  # and when that was [slots]
    is_active: Bool[np.ndarray, "N"]
    problem: Problem

    def needs_weights(
        self, now: float, position_m: Float[np.ndarray, "N D"], is_active: Bool[np.ndarray, "N"]
    ) -> bool:
        """Return whether news must be weighed anew: robots failed or came back, or moved on."""
        if not np.array_equal(self.is_active, is_active):
            return True
        is_old = now - self.weighed >= WEIGHED_SLOTS
        return is_old and not np.array_equal(self.weighed_m, position_m)


class LookaheadOracle(CentralisedPolicy):
    """Plans broadcasts some slots ahead; not optimal.

    Centralised: it sees all buffers and all true positions, and tells every robot at no cost.
    """

    about = Listed(
        name="lookahead-oracle",
        origin=Bound(),
        rank=140,
        uses=(
            "T in all buffers, all true positions and the true channel except its fades, in every "
            "slot, and which robots have failed"
        ),
        beyond=(Information.TRUE_POSITIONS, Information.ALL_BUFFERS, Information.TRUE_CHANNEL),
        payload=None,
        look=Look(
            label="lookahead-oracle", colour="#aa55ff", marker="p", marker_size=5.0, line_width=0.8
        ),
        memory=PairMemory(bytes_per_pair=80.0),
    )

    @classmethod
    def for_mission(cls, mission: Mission) -> "LookaheadOracle":
        """Return the policy for a mission's radio."""
        return cls(mission)

    def __init__(self, mission: Mission) -> None:
        """Prepare the policy for the mission's radio, in free space unless informed otherwise."""
        self._truth = TrueLinks(radio=radio_of(mission))
        # Teams of all sizes look ahead here; the planner's robots would each have to.
        self._settings = PlannerSettings(
            rest_lookahead=LOOKAHEAD, max_lookahead_robots=mission.num_robots
        )

    def window(self, mission: Mission) -> DoubleBroadcast:
        """Return what the robots do in a window: they broadcast twice, unanswered."""
        return two_broadcasts(mission)

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:  # noqa: ARG002
        """Forget the last missions; it draws nothing. Arguments as in `Policy.start`."""
        self._scenes: list[_Scene | None] = [None] * len(rngs)

    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """Return who broadcasts in the next slot; before the first, robots move, unforeseen."""
        timestamp = (SLOTS_PER_WINDOW * views.buffers.timestamp).astype(np.float32)
        ends = (SLOTS_PER_WINDOW * views.now + 1.0).tolist()
        recipient = views.silence.copy()
        for b, now in enumerate(ends):
            problem = self._problem(b, now, states)
            all_free = np.ones(problem.depth, dtype=bool)
            recipient[b, schedule_slot(timestamp[b], now, problem, all_free)] = BROADCAST
        return recipient

    def _problem(self, b: int, now: float, states: RobotStates) -> Problem:
        """Return the problem of a mission's slot that ends now [slots]."""
        position_m = states.position_m[b]
        is_active = np.ones(len(position_m), dtype=bool)
        if states.is_active is not None:
            is_active = states.is_active[b]
        scene = self._scenes[b]
        if scene is None or scene.needs_weights(now, position_m, is_active):
            links = self._links(b, position_m, is_active)
            scene = _Scene(
                position_m=position_m,
                weighed_m=position_m,
                weighed=now,
                is_active=is_active,
                problem=problem_of(links, self._settings, is_certain=True),
            )
        elif not np.array_equal(scene.position_m, position_m):
            links = self._links(b, position_m, is_active)
            problem = over_other_links(scene.problem, links)
            scene = replace(scene, position_m=position_m, problem=problem)
        self._scenes[b] = scene
        return scene.problem

    def _links(
        self, b: int, position_m: Float[np.ndarray, "N D"], is_active: Bool[np.ndarray, "N"]
    ) -> Links:
        """Return the true links of a mission, of robots that have not failed."""
        links = self._truth.links(position_m, b)
        return links if np.all(is_active) else among(links, is_active)
