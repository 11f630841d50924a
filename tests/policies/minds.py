"""The planner's robots, one object each, which share nothing; and the planner's flights.

A mind is handed its own buffer row and copies of the packets that it decoded, and plans alone.
"""

import copy
from dataclasses import dataclass, field

import numpy as np

from swarm_mj.channel import radio_of
from swarm_mj.policies import DecentralisedPolicy, make_policy
from swarm_mj.policies.schedule import greedy_schedule, links_between
from swarm_mj.radio import FreeSpaceRadio
from swarm_mj.swarm import Swarm

WINDOW_S = 0.1


@dataclass(kw_only=True)
class Picture:
    """One robot's belief, as it travels in a packet."""

    is_known: np.ndarray  # [subject]
    position_m: np.ndarray  # [subject, axis]
    spread_m: np.ndarray  # [subject]
    goodness: tuple[int, float, int]  # the less the better
    timestamp: np.ndarray  # T at the start of the epoch it is for, as its maker expects

    def content(self):
        return [array.tolist() for array in (self.is_known, self.position_m, self.spread_m)]


@dataclass(kw_only=True)
class Mind:
    """One robot: its identity, the common speaking order and radio, and its memory."""

    me: int
    order: list[int]
    radio: FreeSpaceRadio
    shares_pictures: bool
    directly: dict[int, float] = field(default_factory=dict)  # when it last decoded whom
    current: Picture | None = None
    upcoming: Picture | None = None
    recipients: np.ndarray | None = None  # its plan's
    after: np.ndarray | None = None  # T that its plan leads to
    epoch: int = -1
    epoch_began: float = 0.0

    @property
    def num_windows(self):
        return max(10, len(self.order) // 2)

    def packet(self):
        """What it sends beyond T, M and P."""
        return copy.deepcopy((self.current, self.upcoming)) if self.shares_pictures else None

    def hear(self, sender, packet, now):
        self.directly[sender] = now
        if packet is not None:
            current, upcoming = packet
            if current is not None and current.goodness < self.current.goodness:
                self.current = current
                self.plan()
            if upcoming is not None and upcoming.goodness < self.upcoming.goodness:
                self.upcoming = upcoming

    def plan(self):
        """The epoch as its picture has it, from the beginning."""
        held = self.current
        links = links_between(self.radio, held.position_m, held.spread_m, held.is_known)
        self.recipients, self.after = greedy_schedule(
            held.timestamp, self.epoch_began, links, self.num_windows, is_squared=True
        )

    def unknown(self):
        return np.zeros((len(self.order), len(self.order)))

    def picture(self, row, now, epochs_ahead, timestamp):
        """Frozen from its own buffer row: T, positions and velocities of everyone it heard of."""
        seen, position_m, velocity_mps = row
        is_known = seen > 0.0
        is_known[self.me] = True
        subjects = np.flatnonzero(is_known).tolist()
        age = [now - float(seen[k]) if k in subjects else 0.0 for k in range(len(self.order))]
        mean_mps = np.sum(velocity_mps[subjects], axis=0) / len(subjects)
        squared_off = [np.sum((velocity_mps[k] - mean_mps) ** 2) for k in subjects]
        deviation_mps = np.sqrt(sum(squared_off) / len(subjects))
        ahead = np.array(age) + epochs_ahead * self.num_windows
        moves_s = np.minimum(ahead, 15.0) * WINDOW_S
        return Picture(
            is_known=is_known,
            position_m=position_m + velocity_mps * moves_s[:, None],
            spread_m=0.45 * deviation_mps * WINDOW_S * ahead,
            goodness=(-len(subjects), sum(age) / len(subjects), self.me),
            timestamp=timestamp,
        )

    def decide(self, row, now):
        """Whom it addresses in the window that begins now."""
        if int(now) // self.num_windows != self.epoch:
            self.epoch, self.epoch_began = int(now) // self.num_windows, now
            if self.shares_pictures:
                self.begin_sharing(row, now)
            else:
                self.begin_alone(row, now)
        if self.recipients is None:
            return self.discover(int(now))
        if int(now) % 4 == 0 and not all(self.current.is_known.tolist()):
            return self.discover(int(now) // 4)
        return int(self.recipients[int(now - self.epoch_began), self.me])

    def begin_sharing(self, row, now):
        """The best picture it holds becomes the one it flies by; it freezes its own for later."""
        self.current, self.upcoming = self.upcoming, None
        if self.current is not None:
            self.plan()
        if self.epoch >= 2:
            after = self.unknown() if self.after is None else self.after
            self.upcoming = self.picture(row, now, 1.5, after)

    def begin_alone(self, row, now):
        """Its own picture; T goes on only while the picture stays, and not every fifth epoch."""
        if self.epoch >= 3:
            before, after = self.current, self.after
            self.current = self.picture(row, now, 0.5, self.unknown())
            is_same = before is not None and before.content() == self.current.content()
            if is_same and self.epoch % 5 != 0:
                self.current.timestamp = after
            self.plan()

    def discover(self, turn):
        num_robots = len(self.order)
        if self.order[turn % num_robots] != self.me:
            return self.me
        if not self.directly:
            return self.order[(turn + 1) % num_robots]
        return min(self.directly, key=lambda k: (self.directly[k], k))


def converse(minds, heard, now):
    """One phase: all packets are written, then everyone reads the one it decoded."""
    packets = [mind.packet() for mind in minds]
    for mind, sender in zip(minds, heard, strict=True):
        if sender != mind.me:
            mind.hear(sender, packets[sender], now)


def rows(buffers, i):
    """Robot i's own T, positions and velocities."""
    arrays = (buffers.timestamp, buffers.position_m, buffers.velocity_mps)
    return [array[0, i].copy() for array in arrays]


@dataclass
class Flight:
    """One mission of a planner, window by window."""

    swarm: Swarm
    policy: DecentralisedPolicy

    @classmethod
    def of(cls, mission, seed, name="planner", channel=None):
        swarm, policy = Swarm(mission, [seed], channel=channel), make_policy(name, mission)
        swarm.start(policy)
        return cls(swarm=swarm, policy=policy)

    @property
    def team(self):
        return self.policy._teams[0]

    def windows(self, num_windows):
        """Flies on; yields when each window began, and whom the robots address in it."""
        for _ in range(num_windows):
            recipient = self.swarm.decide(self.policy)
            yield int(self.swarm.now[0]), recipient[0]
            self.swarm.exchange(recipient)


def cut_off(mission, robot, windows, *, is_mute=True, is_deaf=True):
    """The mission's radio, but in these windows nobody hears the robot, nor it anybody."""
    radio, num_calls = radio_of(mission), 0

    def channel(position_m, recipient):
        nonlocal num_calls
        window, num_calls = num_calls // 2, num_calls + 1
        heard = radio(position_m, recipient)
        if window in windows:
            heard = np.where((heard == robot) & is_mute, np.arange(heard.shape[1]), heard)
            heard[:, robot] = robot if is_deaf else heard[:, robot]
        return heard

    return channel


def minds_of(flight, mission):
    return [
        Mind(
            me=i,
            order=flight.team._order.tolist(),
            radio=radio_of(mission),
            shares_pictures=flight.policy.carries_payload,
        )
        for i in range(mission.num_robots)
    ]


def thinks_alike(mission, seed, name, num_windows, channel=None):
    """Flies the planner beside minds that share nothing, which must decide the same throughout.

    Returns:
        The minds, and how often one took over a better picture amid an epoch.
    """
    flight = Flight.of(mission, seed, name, channel)
    minds, num_taken = minds_of(flight, mission), 0
    for now, recipient in flight.windows(num_windows):
        for phase in flight.swarm.phases:
            before = [mind.current for mind in minds]
            converse(minds, phase.heard[0].tolist(), float(now))
            num_taken += sum(
                mind.current is not old for mind, old in zip(minds, before, strict=True)
            )
        decided = [mind.decide(rows(flight.swarm.buffers, mind.me), float(now)) for mind in minds]
        assert decided == recipient.tolist(), f"window {now}"
    return minds, num_taken
