"""The common-knowledge planner of teams that move; teams at rest have `resting.py`.

Every robot computes the whole team's schedule, and flies its part.

Identities, the team's size, its area, orders and the clock are common before the mission. Robots
that also hold the same snapshot of the team therefore agree on a schedule without a word. Any robot
may transmit in every slot, and nobody answers. Time is divided into epochs:

1. In the first two, the discovery, robots transmit in turns (`discovery.py`). There is none where
   robots are told before the mission where everyone starts.
2. At the start of every epoch but the first, each robot takes a snapshot of the team from its own
   buffer. Packets carry the best snapshot for the next epoch and the one that the sender flies by.
   A robot that decodes a better one takes it over and passes it on. The best has most robots heard
   of lately, then the least age, then the lower identity. So a connected team soon holds one.
3. In the next epoch every robot runs the same scheduler (`broadcast_scheduler.py`) on the best
   snapshot it holds, and transmits when the schedule says so. The timestamps at the start are those
   that the last schedule leads to, so nobody needs to report what it decoded.

Believed positions become uncertain with their age, the more so the more the robots' velocities
differ. Packets over uncertain links are expected to decode with a probability. A robot that missed
the best snapshot flies by the best it has, may collide, and still listens. A snapshot that lacks
robots is not flown by: the discovery goes on, for up to five rounds of N windows or 200 windows.
After that, and whenever a robot has not been heard of for long, every fifth window is left to the
search for it.

A packet carries, beyond T, M and P, two snapshots (`payloads.py`): who took each, N ages, N
positions, how much velocities differ, and the N² timestamps that the last plan leads to. That makes
7.3 kB for 40 robots, 27 kB for 80, and 164 kB for 200. Where a mission's slots hold less, packets
carry lean snapshots.
"""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Int

from swarm_mj.mission import Mission
from swarm_mj.policies.planner.discovery import Discovery
from swarm_mj.policies.planner.payloads import SnapshotForm, snapshot_form
from swarm_mj.policies.planner.plan import Plan
from swarm_mj.policies.planner.settings import EpochSettings, PlannerSettings
from swarm_mj.policies.planner.snapshots import Snapshots, take_snapshots
from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.protocol.buffers import NEVER, Buffers
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.protocol.packets import PacketField
from swarm_mj.protocol.window import SLOT_WINDOWS, SLOTS_PER_WINDOW
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.link_models import Belief


class Planner(BroadcastPolicy):
    """Every robot plans for the whole team from a snapshot that its teammates hold too.

    Uses the robot's own buffer, the snapshots in the packets that it decoded, its identity, the
    team's size and area, the clock, the radio's numbers and common orders of turns, and what the
    mission grants of the channel.
    """

    uses = (
        "its buffer, the clock, common orders, the area, the radio as far as it was told of it; "
        "and snapshots of the team that packets carry"
    )

    def __init__(
        self,
        radio: FreeSpaceRadio,
        settings: PlannerSettings,
        form: SnapshotForm,
        *,
        window_s: float,
        range_m: float,
        side_m: float,
    ) -> None:
        """Prepare the policy.

        Args:
            radio: What robots believe in unless the policy is informed otherwise.
            settings: What was tuned.
            form: How much of a snapshot packets carry.
            window_s: Duration of a window [s].
            range_m: Distance up to which a lone packet decodes [m].
            side_m: Side of the area that the robots start in [m].
        """
        self._belief = Belief(radio=radio)
        self._settings = settings
        self._form = form
        self._window_s = window_s
        self._range_m = range_m
        self._num_reaches = side_m**2 / (math.pi * range_m**2)

    @property
    def payload(self) -> str:
        """Packets carry two snapshots of the team, taken earlier."""
        return self._form.payload

    def payload_fields(self, mission: Mission) -> tuple[PacketField, ...]:
        """Of these snapshots; arguments as in `Policy.payload_fields`."""
        return snapshot_form(mission).fields

    def inform(self, belief: Belief) -> None:
        """Plans by this belief from now on."""
        self._belief = belief

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draws each mission's orders of turns and forgets; arguments as in `Policy.start`."""
        self._teams = [
            _Team(
                self._belief,
                self._window_s,
                self._settings,
                self._form,
                Discovery(num_robots, self._num_reaches, self._range_m, self._settings, rng),
            )
            for rng in rngs
        ]

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Whoever transmits by its plan, or by the discovery."""
        return np.stack([self.transmits_in(views, b) for b in range(len(self._teams))])

    def transmits_in(self, views: LocalViews, b: int) -> Bool[np.ndarray, "N"]:
        """Return the same in one mission alone."""
        return self._teams[b].transmits(views, b)


class _Team:
    """The robots of one mission, side by side: row i of every array is robot i's memory."""

    def __init__(
        self,
        belief: Belief,
        window_s: float,
        settings: PlannerSettings,
        form: SnapshotForm,
        discovery: Discovery,
    ) -> None:
        self._belief = belief
        self._window_s = window_s
        self._settings = settings
        self._form = form
        self._discovery = discovery
        self._everyone = np.arange(discovery.num_robots)
        self._starts = epoch_starts(discovery.num_robots, settings.epochs)
        self._first: float | None = None  # when the first decision was asked for [windows]
        self._epoch = -1
        self._plans: dict[int, Plan] = {}  # of this epoch, by the owner of the snapshot
        self._current: Snapshots | None = None  # taken for this epoch
        self._upcoming: Snapshots | None = None  # taken for the next one
        self._holds = self._everyone  # whose current snapshot i flies by
        self._will_hold = self._everyone  # whose upcoming snapshot is the best that i has
        self._continues = self._everyone  # whose plan i flew by when it took its upcoming one
        self._ended = self._plans  # of the epoch before, and what went with them
        self._ended_continues = self._continues

    def transmits(self, views: LocalViews, b: int) -> Bool[np.ndarray, "N"]:
        """Which robots of mission b transmit in this slot."""
        if self._first is None:
            self._first = float(views.now[b])
        now = float(views.now[b]) - self._first
        slot = round(now / SLOT_WINDOWS)
        heard = views.phases[-1].heard[b] if views.phases else self._everyone
        before = self._holds
        self._take_over(heard)
        if slot % SLOTS_PER_WINDOW == 0 and now >= self._start(self._epoch + 1):
            self._epoch += 1
            self._begin_epoch(views.buffers, b, float(views.now[b]))
        if self._current is None:
            return self._discovery.transmits(slot, views.buffers, b)
        transmits = np.zeros(len(self._everyone), dtype=bool)
        for owner in np.unique(self._holds).tolist():
            holds = self._holds == owner
            by_plan = self._by_plan(owner, slot, heard, before, views.buffers, b)
            transmits[holds] = by_plan[holds]
        return transmits

    def _by_plan(
        self,
        owner: int,
        slot: int,
        heard: Int[np.ndarray, "N"],
        before: Int[np.ndarray, "N"],
        buffers: Buffers,
        b: int,
    ) -> Bool[np.ndarray, "N"]:
        """Who transmits by the plan from this snapshot; what it says of others is not used."""
        plan = self._plan(owner)
        if self._discovery.is_discovered(slot, plan.is_complete):
            return self._discovery.transmits(slot, buffers, b)
        if self._discovery.is_sought(slot, plan.is_fresh):
            was_fresh = self._current.is_fresh[before] if self._current else plan.is_fresh
            return self._discovery.seeks(slot, plan.is_fresh, was_fresh, heard, buffers, b)
        return plan.transmits(slot - SLOTS_PER_WINDOW * self._start(self._epoch))

    def _take_over(self, heard: Int[np.ndarray, "N"]) -> None:
        """Whoever decoded someone takes over its snapshots where they are better."""
        if self._current is not None:
            self._holds = _better(self._current, self._holds, self._holds[heard])
        if self._upcoming is not None:
            self._will_hold = _better(self._upcoming, self._will_hold, self._will_hold[heard])

    def _begin_epoch(self, buffers: Buffers, b: int, now: float) -> None:
        """Flies by the snapshots taken for this epoch, and takes those for the next."""
        self._ended, self._ended_continues = self._plans, self._continues
        self._plans = {}
        is_common = self._epoch == 0 and _is_common(buffers, b)
        if is_common:  # there is nothing to discover
            self._starts = tuple(start - self._starts[1] for start in self._starts[1:])
            self._upcoming = self._snapshots(buffers, b, now, self._length(0) / 2.0)
            self._will_hold = np.zeros_like(self._everyone)  # all snapshots are the same
        self._current, self._holds = self._upcoming, self._will_hold
        if self._epoch > 0 or is_common:
            length, next_length = (self._length(self._epoch + ahead) for ahead in (0, 1))
            self._upcoming = self._snapshots(buffers, b, now, length + next_length / 2.0)
            self._will_hold = self._holds if is_common else self._everyone
            self._continues = self._holds

    def _snapshots(self, buffers: Buffers, b: int, now: float, windows_ahead: float) -> Snapshots:
        """What every robot would plan by so far ahead."""
        taken = take_snapshots(
            buffers.position_m[b],
            buffers.velocity_mps[b],
            buffers.timestamp[b],
            buffers.is_known[b],
            now,
            self._window_s,
            windows_ahead,
            self._settings.snapshots,
        )
        return self._form.arrived(taken, now, windows_ahead)

    def _plan(self, owner: int) -> Plan:
        """Return the plan that follows from someone's snapshot."""
        if owner not in self._plans and self._current is not None:
            before = self._ended.get(int(self._ended_continues[owner]))
            is_at_rest = not np.any(self._current.position_std_m[owner])
            forgets = is_at_rest and self._epoch % self._settings.epochs.forget_every == 0
            if forgets or not self._form.has_table:
                before = None
            start = self._start(self._epoch)
            end = start + self._length(self._epoch)
            is_complete = bool(np.all(self._current.is_known[owner]))
            is_fresh = self._current.is_fresh[owner]
            slots = range(SLOTS_PER_WINDOW * start, SLOTS_PER_WINDOW * end)
            self._plans[owner] = Plan(
                self._belief,
                self._settings,
                self._current,
                owner,
                np.full(is_fresh.shape * 2, NEVER) if before is None else before.outcome(),
                start + (self._first or 0.0),
                np.array([self._is_free(slot, is_complete, is_fresh) for slot in slots]),
            )
        return self._plans[owner]

    def _is_free(self, slot: int, is_complete: bool, is_fresh: Bool[np.ndarray, "N"]) -> bool:
        """Whether a slot is left to the plan."""
        return not (
            self._discovery.is_discovered(slot, is_complete)
            or self._discovery.is_sought(slot, is_fresh)
        )

    def _start(self, epoch: int) -> int:
        """When an epoch begins [windows]."""
        regular = epoch - (len(self._starts) - 1)
        if regular <= 0:
            return self._starts[epoch]
        length = regular_length(len(self._everyone), self._settings.epochs)
        return self._starts[-1] + regular * length

    def _length(self, epoch: int) -> int:
        return self._start(epoch + 1) - self._start(epoch)


def _is_common(buffers: Buffers, b: int) -> bool:
    """Whether all robots know of all robots, and the same: how they were at one moment."""
    timestamp = buffers.timestamp[b]
    return bool(np.all(buffers.is_known[b]) and np.all(timestamp == timestamp[0, 0]))


def epoch_starts(num_robots: int, settings: EpochSettings) -> tuple[int, ...]:
    """When the first epochs begin; the last of these is the first of regular length [windows]."""
    early = max(settings.min_early_windows, round(settings.early_rounds * num_robots))
    first = max(settings.min_early_windows, round(settings.first_rounds * num_robots))
    return (0, first, first + early, first + 2 * early)


def regular_length(num_robots: int, settings: EpochSettings) -> int:
    """How long an epoch is, except for the first ones [windows]."""
    return max(settings.min_regular_windows, round(settings.regular_rounds * num_robots))


def _better(
    snapshots: Snapshots, mine: Int[np.ndarray, "N"], theirs: Int[np.ndarray, "N"]
) -> Int[np.ndarray, "N"]:
    """Whichever of two snapshots has the better rank, robot by robot."""
    return np.where(snapshots.rank[theirs] < snapshots.rank[mine], theirs, mine)
