"""Epochs: one mission's robots agree on snapshots of the team, and fly the plans that follow.

Time is divided into epochs, which the clock gives to all robots alike:

1. In the first two, the discovery, robots transmit in turns (`discovery.py`). There is none where
   robots know before the mission where all start.
2. At the start of every epoch but the first, each robot takes a snapshot of the team from its own
   buffer. Packets carry the best snapshot for the next epoch and the one that the sender flies by.
   A robot that decodes a better one adopts it and passes it on. So a connected team soon holds one.
3. In the next epoch every robot runs the same scheduler (`broadcast_scheduler.py`) on the best
   snapshot it holds, and transmits when the schedule says so. The timestamps at the start are those
   that the last schedule leads to, so nobody needs to report what it decoded.

A robot that missed the best snapshot flies by the best it has, may collide, and still listens. A
snapshot that lacks robots is not flown by: the discovery goes on for some rounds. After that, and
whenever a robot was not heard from for long, some windows are left to the search for it.
"""

import math

import numpy as np
from jaxtyping import Bool, Int

from swarm_mj.mission import Mission
from swarm_mj.policies.planner.discovery import Discovery, Purpose
from swarm_mj.policies.planner.plan import Plan, epoch_plan
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.planner.snapshots import Snapshots, take_snapshots
from swarm_mj.policies.policy import TeamView
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.timestamps import SLOTS_PER_WINDOW, slot_at
from swarm_mj.radio.mission_radio import Belief


class SnapshotTeam:
    """The robots of one mission, side by side: row i of every array is robot i's memory."""

    def __init__(
        self,
        num_robots: int,
        mission: Mission,
        belief: Belief,
        settings: PlannerSettings,
        rng: np.random.Generator,
    ) -> None:
        """Draw the mission's orders of turns, and know nothing of the team."""
        num_reaches = mission.side_m**2 / (math.pi * mission.range_m**2)
        self._discovery = Discovery(
            num_robots, settings, rng, num_reaches=num_reaches, range_m=mission.range_m
        )
        self._belief = belief
        self._settings = settings
        self._window_s = mission.window_s
        self._everyone = np.arange(num_robots)
        self._first_decision: float | None = None  # when the first decision was asked for [windows]
        self._epoch = -1
        self._begin = 0  # of the epoch, after the first decision [windows]
        self._end = 0  # likewise
        self._has_discovery = True
        self._current: Snapshots | None = None  # taken for this epoch
        self._upcoming: Snapshots | None = None  # taken for the next one
        self._plans: dict[int, Plan] = {}  # of this epoch, by the owner of the snapshot
        self._planned_by = self._everyone  # the owner of i's plan when it took its upcoming one
        self._before: list[Plan | None] = []  # what i followed in the last epoch

    def transmits(self, view: TeamView) -> Bool[np.ndarray, "N"]:
        """Return who transmits in this slot; every slot is asked for once, in order."""
        if self._first_decision is None:
            self._first_decision = view.now
        slot = slot_at(view.now - self._first_decision)
        held = self._held()
        # Packets of the last slot carry snapshots of the epoch that may end now, so they are
        # adopted before the next one begins.
        self._adopt(view.heard)
        if slot >= SLOTS_PER_WINDOW * self._end:
            self._begin_epoch(view)
        current = self._current
        if current is None:
            return self._discovery.transmits(slot, view)
        transmits = np.zeros(len(self._everyone), dtype=bool)
        was_fresh = current.is_fresh[held]
        for owner in np.unique(current.held).tolist():
            # Made even where nobody follows it yet, since the next epoch's plan continues it.
            plan = self._plan(current, owner)
            is_fresh = current.is_fresh[owner]
            purpose = self._discovery.purpose(slot, current.is_known[owner], is_fresh)
            if purpose is Purpose.DISCOVERY:
                chosen = self._discovery.transmits(slot, view)
            elif purpose is Purpose.SEARCH:
                chosen = self._discovery.seeks(slot, view, is_fresh=is_fresh, was_fresh=was_fresh)
            else:
                chosen = plan.transmits(slot - SLOTS_PER_WINDOW * self._begin)
            follows = current.held == owner
            transmits[follows] = chosen[follows]
        return transmits

    def _adopt(self, heard: Int[np.ndarray, "N"]) -> None:
        """Let robots take over the better snapshots of those that they decoded."""
        for snapshots in (self._current, self._upcoming):
            if snapshots is not None:
                snapshots.adopt(heard)

    def _held(self) -> Int[np.ndarray, "N"]:
        """Return whose snapshot each robot flies by, itself if it has none yet."""
        return self._everyone if self._current is None else self._current.held.copy()

    def _begin_epoch(self, view: TeamView) -> None:
        """Fly by the snapshots taken for this epoch, and take those for the next."""
        self._epoch += 1
        self._before = [self._plans.get(owner) for owner in self._planned_by.tolist()]
        self._plans = {}
        is_common = self._epoch == 0 and _is_same_picture(view)
        if is_common:
            self._has_discovery = False
        length = self._length(self._epoch)
        self._begin = self._end
        self._end += length
        # Each snapshot is of the middle of the epoch that it is for.
        if is_common:
            self._current = self._take(view, length / 2.0, is_common=True)
        else:
            self._current = self._upcoming
        # In the first epoch of a discovery, buffers are still too empty for snapshots.
        if self._epoch > 0 or is_common:
            to_next = length + self._length(self._epoch + 1) / 2.0
            self._upcoming = self._take(view, to_next, is_common=is_common)
            self._planned_by = self._held()

    def _length(self, epoch: int) -> int:
        """Return how long one of this mission's epochs is [windows]."""
        # Where there is nothing to discover, the first epoch is left out.
        number = epoch if self._has_discovery else epoch + 1
        return epoch_windows(number, len(self._everyone), self._settings)

    def _take(self, view: TeamView, windows_ahead: float, *, is_common: bool) -> Snapshots:
        """Return everyone's snapshot of some windows ahead; if all are the same, they hold one."""
        taken = take_snapshots(
            view, self._settings, window_s=self._window_s, windows_ahead=windows_ahead
        )
        if is_common:
            taken.held[:] = 0
        return taken

    def _plan(self, current: Snapshots, owner: int) -> Plan:
        """Return the plan that follows from someone's snapshot, made when first asked for."""
        if owner not in self._plans:
            self._plans[owner] = self._make_plan(current, owner)
        return self._plans[owner]

    def _make_plan(self, current: Snapshots, owner: int) -> Plan:
        """Return a plan that begins with the T that its owner's last one leads to."""
        before = self._before[owner]
        # At rest nothing else would correct two robots that expect different timestamps.
        is_at_rest = not np.any(current.position_std_m[owner])
        if is_at_rest and self._epoch % self._settings.forget_every == 0:
            before = None
        nothing = np.full(current.is_known.shape, NEVER)
        is_free = []
        for slot in range(SLOTS_PER_WINDOW * self._begin, SLOTS_PER_WINDOW * self._end):
            purpose = self._discovery.purpose(
                slot, current.is_known[owner], current.is_fresh[owner]
            )
            is_free.append(purpose is Purpose.PLAN)
        return epoch_plan(
            current,
            owner,
            self._belief,
            self._settings,
            timestamp=nothing if before is None else before.outcome(),
            now=self._begin + (self._first_decision or 0.0),
            is_free=np.array(is_free),
        )


def _is_same_picture(view: TeamView) -> bool:
    """Return whether all robots hold the same complete picture of one moment."""
    return bool(np.all(view.is_known) and np.all(view.timestamp == view.timestamp[0, 0]))


def epoch_windows(epoch: int, num_robots: int, settings: PlannerSettings) -> int:
    """Return how long an epoch is: the first, two short ones, then all others [windows]."""
    if epoch > 2:
        return max(settings.min_epoch_windows, round(settings.epoch_rounds * num_robots))
    rounds = settings.early_epoch_rounds if epoch > 0 else settings.first_epoch_rounds
    return max(settings.min_early_epoch_windows, round(rounds * num_robots))
