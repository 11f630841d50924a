"""The common-knowledge planner: every robot computes the whole team's schedule, and flies its part.

Identities, the team's size, its area, speaking orders and the clock are common before the mission,
so robots that hold the same picture of the team agree on a schedule without a word. Every half
window any robot may speak; nobody answers. Time is cut into epochs:

1. In the first two, the discovery, robots speak in turns (`discovery.py`).
2. As each but the first begins, every robot freezes a picture of the team from its own buffer. Its
   packets carry the best picture for the next epoch and the one it flies by; whoever decodes a
   better one takes it over and passes it on. The best has most robots heard of lately, then the
   least age, then the lower identity; so a connected team soon holds one picture, whoever is in it.
3. In the next epoch every robot runs the same scheduler (`broadcasts.py`) on the best picture it
   holds, and speaks when the schedule says so. Timestamps at the beginning are those that the last
   schedule leaves; nobody needs to report what it decoded.

Believed positions spread with their age and with how differently the
robots move, so packets over doubtful links are expected to come through with a probability. A
robot that missed the best picture flies by the best it has, may collide, and still listens. While
a picture lacks robots it is not flown by, and the discovery goes on, for up to five rounds or 200
windows; then, and whenever robots have not been heard of for long, every fifth window is left to
seeking them.
"""

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Int

from swarm_mj.policies.greedy_oracle.link_scheduler import HALVES
from swarm_mj.policies.planner.discovery import Discovery
from swarm_mj.policies.planner.plan import Plan
from swarm_mj.policies.planner.snapshots import Pictures, freeze
from swarm_mj.policies.planner.weights import Scorer
from swarm_mj.policies.policy import DecentralisedPolicy, Parameters
from swarm_mj.protocol.buffers import NEVER, Buffers
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.protocol.window import PHASE
from swarm_mj.radio.free_space import FreeSpaceRadio

# These numbers, and those of `pictures` and `discovery`, were the best of a few tried on 20
# missions (seeds from 1000), mostly of 40 robots, stationary and walking.
FIRST_EPOCH = 1.0  # rounds of N windows: before the first pictures are made
EARLY_EPOCH = 0.25  # rounds: the two epochs after it
EPOCH = 0.5  # rounds: all others; a picture must reach all of a team
SHORTEST_EPOCH = 10  # windows
FORGET_EVERY = 5  # epochs: how often resting teams plan anew, so that divided ones agree again
FRESH = 1.0  # rounds without news, after which a robot is sought


class Planner(DecentralisedPolicy):
    """Every robot plans for the whole team from a picture that its teammates hold too.

    Uses its own buffer, its identity, the team's size and area, the clock, the radio's numbers and
    common speaking orders. Packets carry, beyond T, M and P, the sender's two pictures: who made
    each, N ages, N believed positions, N spreads and N² timestamps.
    """

    transmits_twice: ClassVar[bool] = True

    def __init__(
        self,
        radio: FreeSpaceRadio,
        scorer: Scorer,
        *,
        window_s: float,
        range_m: float,
        side_m: float,
    ) -> None:
        """Prepares the policy.

        Args:
            radio: The mission's channel.
            scorer: What news is worth to the schedules.
            window_s: Duration of a window [s].
            range_m: Distance up to which a lone packet decodes [m].
            side_m: Side of the area that the robots start in [m].
        """
        self._radio = radio
        self._window_s = window_s
        self._range_m = range_m
        self._num_reaches = side_m**2 / (math.pi * range_m**2)
        self._scorer = scorer

    @property
    def parameters(self) -> Parameters:
        """The scorer's."""
        return self._scorer.parameters

    @property
    def payload(self) -> str:
        """Packets carry pictures of the team, taken at an earlier time."""
        return "snapshots"

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draws each mission's speaking orders and forgets; arguments as in `Policy.start`."""
        self._teams = [
            _Team(
                self._radio,
                self._window_s,
                self._scorer,
                Discovery(num_robots, self._num_reaches, self._range_m, rng),
            )
            for rng in rngs
        ]

    def recipients(self, views: LocalViews) -> Int[np.ndarray, "B N"]:
        """The next identity, for whoever speaks; who is addressed changes nothing."""
        speaks = np.stack([team.speaks(views, b) for b, team in enumerate(self._teams)])
        return np.where(speaks, (views.silence + 1) % views.num_robots, views.silence)


class _Team:
    """The robots of one mission, side by side: row i of every array is robot i's memory."""

    def __init__(
        self, radio: FreeSpaceRadio, window_s: float, scorer: Scorer, discovery: Discovery
    ) -> None:
        self._radio = radio
        self._window_s = window_s
        self._scorer = scorer
        self._discovery = discovery
        self._everyone = np.arange(discovery.num_robots)
        self._starts = epoch_starts(discovery.num_robots)
        self._first: float | None = None  # when the first decision was asked for [windows]
        self._epoch = -1
        self._plans: dict[int, Plan] = {}  # of this epoch, by whose picture it follows from
        self._current: Pictures | None = None  # made for this epoch
        self._upcoming: Pictures | None = None  # made for the next one
        self._holds = self._everyone  # whose current picture i flies by
        self._will_hold = self._everyone  # whose upcoming picture is the best that i has
        self._continues = self._everyone  # whose plan i flew by when it froze its upcoming one
        self._ended = self._plans  # of the epoch before, and what went with them
        self._ended_continues = self._continues

    def speaks(self, views: LocalViews, b: int) -> Bool[np.ndarray, "N"]:
        """Which robots of mission b speak in this half window."""
        if self._first is None:
            self._first = float(views.now[b])
        now = float(views.now[b]) - self._first
        half_window = round(now / PHASE)
        heard = views.phases[-1].heard[b] if views.phases else self._everyone
        before = self._holds
        self._take_over(heard)
        if half_window % HALVES == 0 and now >= self._start(self._epoch + 1):
            self._epoch += 1
            self._begin_epoch(views.buffers, b, float(views.now[b]))
        if self._current is None:
            return self._discovery.speaks(half_window, views.buffers, b)
        speaks = np.zeros(len(self._everyone), dtype=bool)
        for whose in np.unique(self._holds).tolist():
            holds = self._holds == whose
            by_plan = self._by_plan(whose, half_window, heard, before, views.buffers, b)
            speaks[holds] = by_plan[holds]
        return speaks

    def _by_plan(
        self,
        whose: int,
        half_window: int,
        heard: Int[np.ndarray, "N"],
        before: Int[np.ndarray, "N"],
        buffers: Buffers,
        b: int,
    ) -> Bool[np.ndarray, "N"]:
        """Who speaks by the plan from this picture; what it says of others is not used."""
        plan = self._plan(whose)
        if self._discovery.is_discovered(half_window, plan.is_complete):
            return self._discovery.speaks(half_window, buffers, b)
        if self._discovery.is_sought(half_window, plan.is_fresh):
            was_fresh = self._current.is_fresh[before] if self._current else plan.is_fresh
            return self._discovery.seeks(half_window, plan.is_fresh, was_fresh, heard, buffers, b)
        return plan.speaks(half_window - HALVES * self._start(self._epoch))

    def _take_over(self, heard: Int[np.ndarray, "N"]) -> None:
        """Whoever decoded someone takes over its pictures where they are better."""
        if self._current is not None:
            self._holds = _better(self._current, self._holds, self._holds[heard])
        if self._upcoming is not None:
            self._will_hold = _better(self._upcoming, self._will_hold, self._will_hold[heard])

    def _begin_epoch(self, buffers: Buffers, b: int, now: float) -> None:
        """Flies by the pictures made for this epoch, and freezes those for the next."""
        self._ended, self._ended_continues = self._plans, self._continues
        self._plans = {}
        self._current, self._holds = self._upcoming, self._will_hold
        if self._epoch > 0:
            length, next_length = (self._length(self._epoch + ahead) for ahead in (0, 1))
            self._upcoming = freeze(
                buffers.position_m[b],
                buffers.velocity_mps[b],
                buffers.timestamp[b],
                buffers.is_known[b],
                now,
                self._window_s,
                length + next_length / 2.0,
                max(FRESH * len(self._everyone), 2.0 * SHORTEST_EPOCH),
            )
            self._will_hold, self._continues = self._everyone, self._holds

    def _plan(self, whose: int) -> Plan:
        """The plan that follows from someone's picture."""
        if whose not in self._plans and self._current is not None:
            before = self._ended.get(int(self._ended_continues[whose]))
            if self._epoch % FORGET_EVERY == 0 and not np.any(self._current.spread_m[whose]):
                before = None
            start = self._start(self._epoch)
            half_windows = HALVES * start + np.arange(HALVES * self._length(self._epoch))
            is_complete = bool(np.all(self._current.is_known[whose]))
            is_fresh = self._current.is_fresh[whose]
            self._plans[whose] = Plan(
                self._radio,
                self._scorer,
                self._current,
                whose,
                np.full(is_fresh.shape * 2, NEVER) if before is None else before.outcome(),
                start + (self._first or 0.0),
                np.array([self._is_free(int(h), is_complete, is_fresh) for h in half_windows]),
            )
        return self._plans[whose]

    def _is_free(
        self, half_window: int, is_complete: bool, is_fresh: Bool[np.ndarray, "N"]
    ) -> bool:
        """Whether a half window is left to the plan."""
        return not (
            self._discovery.is_discovered(half_window, is_complete)
            or self._discovery.is_sought(half_window, is_fresh)
        )

    def _start(self, epoch: int) -> int:
        """When an epoch begins [windows]."""
        regular = epoch - (len(self._starts) - 1)
        if regular <= 0:
            return self._starts[epoch]
        return self._starts[-1] + regular * regular_length(len(self._everyone))

    def _length(self, epoch: int) -> int:
        return self._start(epoch + 1) - self._start(epoch)


def epoch_starts(num_robots: int) -> tuple[int, ...]:
    """When the first epochs begin; the last of these is the first of regular length [windows]."""
    early = max(2, round(EARLY_EPOCH * num_robots))
    first = max(2, round(FIRST_EPOCH * num_robots))
    return (0, first, first + early, first + 2 * early)


def regular_length(num_robots: int) -> int:
    """How long an epoch is, but for the first ones [windows]."""
    return max(SHORTEST_EPOCH, round(EPOCH * num_robots))


def _better(
    pictures: Pictures, mine: Int[np.ndarray, "N"], theirs: Int[np.ndarray, "N"]
) -> Int[np.ndarray, "N"]:
    """Whichever of two pictures has the better rank, robot by robot."""
    return np.where(pictures.rank[theirs] < pictures.rank[mine], theirs, mine)
