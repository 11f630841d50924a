"""The common-knowledge planner: every robot computes the whole team's schedule, and flies its part.

Identities, the team's size, a speaking order and the clock are common before the mission, so robots
that hold the same picture of the team agree on a schedule without a word. Time is cut into epochs:

1. In the first epochs, the discovery, one robot after the other speaks, as in TDMA, to whichever
   neighbour it has not heard directly for longest, which answers.
2. As an epoch begins, every robot freezes a picture of the team from its own buffer. Its packets
   carry the best picture for the next epoch and the one it flies by; whoever decodes a better one
   takes it over and passes it on. The best knows most robots, then has the least age, then comes
   from the lower identity; so a connected team soon holds one picture, whoever is in it.
3. In the next epoch every robot runs the same greedy scheduler (`greedy.py`) on the best picture it
   holds and addresses whom the schedule says. Timestamps at the beginning are those that the last
   schedule leaves; nobody needs to report what it decoded.

What fails, fails softly. Believed positions spread with their age and with how differently the
robots move, so packets over doubtful links are expected to come through with a probability, and
teammates out of reach are called now and then. A robot that missed the best picture flies by the
best it has, may collide, still answers and still listens. While a picture lacks robots, every
`DISCOVERY_EVERY`-th window goes on with the discovery, so that nobody stays unheard of.
"""

from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence

import numpy as np
from jaxtyping import Bool, Int

from swarm_mj.buffers import NEVER, Buffers
from swarm_mj.policies.pictures import Pictures, Plan, epoch_windows, freeze, make_plan
from swarm_mj.policies.policy import DecentralisedPolicy, LocalViews
from swarm_mj.radio import FreeSpaceRadio

# These numbers, and those of `pictures`, were the best of a few tried on 20 missions (seeds from
# 1000) of 40 robots, stationary and walking.
DISCOVERY_EPOCHS = 3  # before the first schedule: one and a half rounds for teams above 20
DISCOVERY_EVERY = 4  # windows, while a picture lacks robots
FORGET_EVERY = 5  # epochs: how often robots that share no pictures begin anew


class Planner(DecentralisedPolicy):
    """Every robot plans for the whole team from a picture that its teammates hold too.

    Uses its own buffer, its identity, the team's size, the clock, the radio's numbers and a common
    speaking order. Packets carry, beyond T, M and P, the sender's two pictures: who made each and
    from how old knowledge, N flags of who is known, N believed positions, N spreads and N²
    timestamps. Without them (`shares_pictures=False`) every robot plans by its own picture alone,
    which agrees with its teammates' only where nobody moves.
    """

    def __init__(
        self, radio: FreeSpaceRadio, window_s: float, *, shares_pictures: bool = True
    ) -> None:
        """Prepares the policy.

        Args:
            radio: The mission's channel.
            window_s: Duration of a window [s].
            shares_pictures: Whether packets carry pictures.
        """
        self._radio = radio
        self._window_s = window_s
        self._shares_pictures = shares_pictures

    @property
    def carries_payload(self) -> bool:
        """Whether packets carry pictures."""
        return self._shares_pictures

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draws each mission's speaking order and forgets; arguments as in `Policy.start`."""
        kind = _SharingTeam if self._shares_pictures else _LoneTeam
        self._teams = [
            kind(self._radio, self._window_s, rng.permutation(num_robots)) for rng in rngs
        ]

    def recipients(self, views: LocalViews) -> Int[np.ndarray, "B N"]:
        """The robots' parts of the schedules they hold, or of the discovery."""
        return np.stack([team.recipients(views, b) for b, team in enumerate(self._teams)])


class _Team(ABC):
    """The robots of one mission, side by side: row i of every array is robot i's memory."""

    def __init__(self, radio: FreeSpaceRadio, window_s: float, order: Int[np.ndarray, "N"]) -> None:
        num_robots = len(order)
        self._radio = radio
        self._window_s = window_s
        self._order = order
        self._epoch_windows = epoch_windows(num_robots)
        self._epoch = -1
        self._everyone = np.arange(num_robots)
        self._directly = np.full((num_robots, num_robots), NEVER)  # when i last decoded k [windows]
        self._plans: dict[Hashable, Plan] = {}  # of this epoch; robots that hold one share it

    def recipients(self, views: LocalViews, b: int) -> Int[np.ndarray, "N"]:
        """Whom the robots of mission b address."""
        now = float(views.now[b])
        for phase in views.phases:
            self._listen(phase.heard[b], now)
        epoch, window = divmod(int(now), self._epoch_windows)
        if epoch != self._epoch:
            self._epoch = epoch
            self._begin_epoch(views.buffers, b, now)
        if not self._plans:
            return self._discover(int(now))
        return self._fly_plans(int(now), window)

    def _listen(self, heard: Int[np.ndarray, "N"], now: float) -> None:
        """Notes who was decoded."""
        decoded = heard != self._everyone
        self._directly[self._everyone[decoded], heard[decoded]] = now

    @abstractmethod
    def _begin_epoch(self, buffers: Buffers, b: int, now: float) -> None:
        """Freezes pictures, and leaves in `_plans` what follows from those in use."""

    @abstractmethod
    def _holders(self) -> dict[Hashable, Bool[np.ndarray, "N"]]:
        """Which robots fly by which plan."""

    def _freeze(self, buffers: Buffers, b: int, now: float, epochs_ahead: float) -> Pictures:
        return freeze(
            buffers.position_m[b],
            buffers.velocity_mps[b],
            buffers.timestamp[b],
            buffers.is_known[b],
            now,
            self._window_s,
            epochs_ahead * self._epoch_windows,
        )

    def _fly_plans(self, now: int, window: int) -> Int[np.ndarray, "N"]:
        """Each robot's part of the plan it holds, or of the discovery that goes on."""
        recipient = self._everyone.copy()
        for key, holds in self._holders().items():
            scheduled = self._plans[key].recipient[window]
            if not self._plans[key].is_complete and now % DISCOVERY_EVERY == 0:
                scheduled = self._discover(now // DISCOVERY_EVERY)
            recipient[holds] = scheduled[holds]
        return recipient

    def _discover(self, turn: int) -> Int[np.ndarray, "N"]:
        """The robot whose turn it is addresses the neighbour it has longest not heard directly."""
        num_robots = len(self._order)
        speaker = self._order[turn % num_robots]
        recipient = self._everyone.copy()
        directly = self._directly[speaker]
        stalest = int(np.argmin(np.where(directly > NEVER, directly, np.inf)))
        anyone = self._order[(turn + 1) % num_robots]
        recipient[speaker] = stalest if directly[stalest] > NEVER else anyone
        return recipient


class _SharingTeam(_Team):
    """Packets carry the picture the sender flies by, and the best it has for the next epoch."""

    def __init__(self, radio: FreeSpaceRadio, window_s: float, order: Int[np.ndarray, "N"]) -> None:
        super().__init__(radio, window_s, order)
        self._current: Pictures | None = None  # made for this epoch
        self._upcoming: Pictures | None = None  # made for the next one
        self._holds = self._everyone  # whose current picture i flies by
        self._will_hold = self._everyone  # whose upcoming picture is the best that i has
        self._continues = self._everyone  # whose plan i flew by when it froze its upcoming one

    def _listen(self, heard: Int[np.ndarray, "N"], now: float) -> None:
        """Notes who was decoded, and takes over its pictures where they are better."""
        super()._listen(heard, now)
        if self._current is not None:
            self._holds = _better(self._current, self._holds, self._holds[heard])
        if self._upcoming is not None:
            self._will_hold = _better(self._upcoming, self._will_hold, self._will_hold[heard])

    def _begin_epoch(self, buffers: Buffers, b: int, now: float) -> None:
        ended = self._plans
        self._current, self._holds = self._upcoming, self._will_hold
        self._plans = {}
        if self._current is not None:
            unknown = np.full(self._directly.shape, NEVER)
            for whose in np.unique(self._holds).tolist():
                before = ended.get(int(self._continues[whose]))
                timestamp = before.timestamp if before else unknown
                self._plans[whose] = make_plan(self._radio, self._current, whose, timestamp, now)
        if self._epoch >= DISCOVERY_EPOCHS - 1:
            self._upcoming = self._freeze(buffers, b, now, epochs_ahead=1.5)
            self._will_hold, self._continues = self._everyone, self._holds

    def _holders(self) -> dict[Hashable, Bool[np.ndarray, "N"]]:
        return {whose: self._holds == whose for whose in np.unique(self._holds).tolist()}


class _LoneTeam(_Team):
    """Packets carry T, M and P alone: everyone plans by its own picture.

    Robots whose pictures became equal at different times must come to equal plans too, so everyone
    forgets what the last plan led to, every `FORGET_EVERY` epochs and when its picture changes.
    Robots share a computed plan if their pictures are equal and have been since the same epoch.
    """

    def __init__(self, radio: FreeSpaceRadio, window_s: float, order: Int[np.ndarray, "N"]) -> None:
        super().__init__(radio, window_s, order)
        self._keys: dict[int, tuple[Hashable, int]] = {}  # i's picture, and its first epoch

    def _begin_epoch(self, buffers: Buffers, b: int, now: float) -> None:
        is_forgotten = self._epoch % FORGET_EVERY == 0
        ended, before = ({}, {}) if is_forgotten else (self._plans, self._keys)
        self._plans, self._keys = {}, {}
        if self._epoch >= DISCOVERY_EPOCHS:
            pictures = self._freeze(buffers, b, now, epochs_ahead=0.5)
            unknown = np.full(self._directly.shape, NEVER)
            for i in self._everyone.tolist():
                content = _content(pictures, i)
                content_before, first_epoch = before.get(i, (None, self._epoch))
                key = (content, first_epoch if content == content_before else self._epoch)
                self._keys[i] = key
                if key not in self._plans:
                    timestamp = ended[key].timestamp if key in ended else unknown
                    self._plans[key] = make_plan(self._radio, pictures, i, timestamp, now)

    def _holders(self) -> dict[Hashable, Bool[np.ndarray, "N"]]:
        keys = self._keys.values()
        return {key: np.array([held == key for held in keys]) for key in self._plans}


def _better(
    pictures: Pictures, mine: Int[np.ndarray, "N"], theirs: Int[np.ndarray, "N"]
) -> Int[np.ndarray, "N"]:
    """Whichever of two pictures has the better rank, robot by robot."""
    return np.where(pictures.rank[theirs] < pictures.rank[mine], theirs, mine)


def _content(pictures: Pictures, i: int) -> Hashable:
    """All that a plan by picture i depends on."""
    parts = (pictures.is_known[i], pictures.position_m[i], pictures.spread_m[i])
    return tuple(part.tobytes() for part in parts)
