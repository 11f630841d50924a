"""The planner's robots, one object each, which share nothing; and flights of a planner beside them.

A mind is handed its own buffer row and copies of the packets that it decoded, and plans alone.
"""

import copy
import math
from dataclasses import dataclass, field

import numpy as np

from swarm_mj.mission import Mission
from swarm_mj.policies.planner.broadcast_scheduler import schedule_slot
from swarm_mj.policies.planner.plan import problem_of
from swarm_mj.policies.planner.policy import Planner
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.radio.links import links_between
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.simulation.swarm import Swarm

SETTINGS = PlannerSettings()


@dataclass(kw_only=True)
class Snapshot:
    """One robot's belief, as it travels in a packet."""

    is_known: np.ndarray  # [subject]
    is_fresh: np.ndarray  # [subject]
    position_m: np.ndarray  # [subject, axis]
    position_std_m: np.ndarray  # [subject]
    seen: np.ndarray  # T of its maker [subject]
    before: np.ndarray  # T of everyone at the start of the epoch it is for, as its maker expects
    goodness: tuple[int, float, int]  # the less the better

    @property
    def is_complete(self):
        return all(self.is_known.tolist())


def common_orders(seed, mission, settings=SETTINGS):
    """The order of the search and the groups of the discovery, in a round each [round, group].

    Of those that reach over the area a share transmits at once, and fewer after the first rounds;
    one at least, and never all.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed).spawn(4)[2])
    num_robots = mission.num_robots
    order = rng.permutation(num_robots).tolist()
    reaches = mission.side_m**2 / (math.pi * mission.range_m**2)
    at_once = max(
        1, min(settings.max_transmitters, round(settings.transmitters_per_reach * reaches))
    )
    later = max(1, math.floor(at_once * settings.later_share))
    rounds = []
    for k in range(settings.num_orders):
        count = min(at_once if k < settings.num_fast_rounds else later, num_robots - 1)
        robots = rng.permutation(num_robots).tolist()
        rounds.append([robots[first : first + count] for first in range(0, num_robots, count)])
    return order, rounds


@dataclass(kw_only=True)
class Mind:
    """One robot: its identity, what is common before the mission, and its memory."""

    me: int
    mission: Mission
    settings: PlannerSettings
    order: list[int]
    groups: list[list[int]]
    epoch: int = -1
    begins: int = 0  # when the next epoch does [windows]
    current: Snapshot | None = None
    upcoming: Snapshot | None = None
    flown: Snapshot | None = None  # what it flew by in the slot before
    heard: int | None = None  # whom it decoded then
    took_over: int = 0  # how often it found a better snapshot amid an epoch
    schedule: list[bool] = field(default_factory=list)  # whether it transmits, by slots
    after: np.ndarray | None = None  # T that its plan leads to

    @property
    def is_told(self):
        """Whether it was told before the mission where everyone starts."""
        return "start" in self.mission.prior_knowledge

    def length(self, epoch):
        """The discovery, two early ones, then all others [windows]."""
        epochs = self.settings
        epoch += self.is_told  # then there is no discovery
        if epoch >= 3:
            return max(epochs.min_epoch_windows, round(epochs.epoch_rounds * len(self.order)))
        rounds = epochs.first_epoch_rounds if epoch == 0 else epochs.early_epoch_rounds
        return max(2, round(rounds * len(self.order)))

    def packet(self):
        """What it sends in this slot beside T, M and P."""
        return copy.deepcopy((self.current, self.upcoming))

    def hear(self, sender, packet):
        """One slot: whom it decoded, if anybody, and what came beside T, M and P."""
        self.heard = sender
        current, upcoming = packet or (None, None)
        if current is not None and current.goodness < self.current.goodness:
            self.current, self.took_over = current, self.took_over + 1
            self.plan()
        if upcoming is not None and upcoming.goodness < self.upcoming.goodness:
            self.upcoming = upcoming

    def transmits(self, row, slot):
        """Whether it does in the slot that begins now."""
        if slot == 2 * self.begins:
            self.begin(row, slot // 2)
        flown, self.flown = self.flown, self.current
        if self.current is None or self.calls(slot):
            return self.has_its_turn(row, slot)
        if self.seeks(slot):
            turn = slot // 2 // self.settings.search_every_windows
            if slot % 2 == 0:
                return self.order[turn % len(self.order)] == self.me
            return self.answers(row, turn, flown)
        return self.schedule[slot - 2 * (self.begins - self.length(self.epoch))]

    def begin(self, row, now):
        """The best snapshot it holds becomes the one it flies by; it takes its own for later."""
        self.epoch += 1
        self.begins += self.length(self.epoch)
        self.current, self.upcoming = self.upcoming, None
        if self.epoch == 0 and self.is_told:
            self.current = self.snapshot(row, now, self.length(0) / 2)
        if self.current is not None:
            self.plan()
        if self.current is not None or self.epoch >= 1:
            ahead = self.length(self.epoch) + self.length(self.epoch + 1) / 2
            self.upcoming = self.snapshot(row, now, ahead)

    def snapshot(self, row, now, windows_ahead):
        """Frozen from its own buffer row: T, positions and velocities of everyone it heard of."""
        seen, position_m, velocity_mps = row
        num_robots, window_s = len(seen), self.mission.window_s
        known = [k for k in range(num_robots) if seen[k] > 0.0]
        age = [float(now - seen[k]) if k in known else 0.0 for k in range(num_robots)]
        believes = self.settings
        oldest = max(believes.fresh_rounds * num_robots, believes.min_fresh_windows)
        fresh = [k for k in known if age[k] <= oldest]
        mean_mps = np.sum(velocity_mps[known], axis=0) / len(known)
        off = sum(np.sum((velocity_mps[k] - mean_mps) ** 2) for k in known)
        ahead = np.array(age) + windows_ahead
        moves_s = np.minimum(ahead, believes.steady_windows) * window_s
        robots, empty = np.arange(num_robots), np.zeros((num_robots, num_robots))
        is_divided = len(known) == num_robots and off == 0.0 and len(fresh) < 0.75 * num_robots
        return Snapshot(
            is_known=np.isin(robots, known),
            is_fresh=np.isin(robots, known if is_divided else fresh),
            position_m=position_m + velocity_mps * moves_s[:, None],
            position_std_m=believes.std_per_distance * np.sqrt(off / len(known)) * window_s * ahead,
            seen=seen,
            before=empty if self.after is None else self.after,
            goodness=(-len(fresh), sum(age[k] for k in fresh) / len(fresh), self.me),
        )

    def plan(self):
        """The epoch as its snapshot has it, from the beginning, in one go."""
        held, length = self.current, self.length(self.epoch)
        begun = self.begins - length
        unheard = begun - np.array(held.seen)
        is_near = unheard <= self.settings.gone_rounds * max(20, len(unheard))
        is_there = held.is_known & (is_near | held.is_fresh)
        links = links_between(
            radio_of(self.mission), held.position_m, held.position_std_m, is_there
        )
        rests = not held.position_std_m.any()
        known = held.before * (not (rests and self.epoch % self.settings.forget_every == 0))
        for k in np.flatnonzero(~held.is_fresh):
            known[k] = np.minimum(known[k], held.seen[k])
            known[:, k] = np.minimum(known[:, k], held.seen[k])
        problem = problem_of(links, self.settings, is_certain=rests)
        is_free = [not (self.calls(h) or self.seeks(h)) for h in range(2 * begun, 2 * self.begins)]
        halves = (2 * known).astype(np.float32)
        transmits = scheduled(halves, 2.0 * begun, problem, is_free)
        self.schedule, self.after = transmits[:, self.me].tolist(), halves.astype(float) / 2

    def calls(self, slot):
        """Whether the discovery goes on, by its snapshot."""
        return not self.current.is_complete and not self.is_late(slot)

    def seeks(self, slot):
        """Whether the lost are sought, by its snapshot: now and then."""
        is_lacking = not all(self.current.is_fresh.tolist())
        return (
            self.is_late(slot)
            and is_lacking
            and slot // 2 % self.settings.search_every_windows == 0
        )

    def is_late(self, slot):
        """After some rounds, or many windows."""
        rounds = self.settings.search_rounds * len(self.order)
        return slot >= 2 * min(rounds, self.settings.latest_search_windows)

    def has_its_turn(self, row, slot):
        """Whether it is one of the group, and knows nobody near who comes before."""
        group = self.groups[slot % len(self.groups)]
        if self.me not in group:
            return False
        here_m, reach_m = (row[1][self.me], self.settings.polite_ranges * self.mission.range_m)
        return not any(is_near(row, k, here_m, reach_m) for k in group[: group.index(self.me)])

    def answers(self, row, turn, flown):
        """Whether it tells somebody lost, whom it just heard, that it is; or calls as one lost."""
        if self.heard is not None and not flown.is_fresh[self.heard]:
            there_m = row[1][self.heard]
            before = self.order[: self.order.index(self.me)]
            return not any(
                flown.is_fresh[k] and is_near(row, k, there_m, self.mission.range_m)
                for k in before
                if k != self.heard
            )
        lost = [k for k in self.order if not self.current.is_fresh[k]]
        return lost[turn % len(lost)] == self.me


def is_near(row, k, place_m, reach_m):
    """Whether the buffer's owner knows k to be within reach of a place."""
    seen, position_m, _ = row
    return seen[k] > 0.0 and np.hypot(*(position_m[k] - place_m)) < reach_m


def scheduled(timestamp, now, problem, is_free):
    """Who transmits in each slot; T is brought to the end of the last, all after which are free."""
    free = np.array([*is_free, *[True] * problem.depth])
    slots = [
        schedule_slot(timestamp, now + p + 1.0, problem, free[p : p + problem.depth])
        for p in range(len(is_free))
    ]
    return np.array(slots)


PLANNED = {}  # by exactly what plans follow from, which spares working them out for every robot


def planned(links, settings, num_slots):
    """Who transmits in each slot, in one go, in a team that knows nothing at first."""
    key = (*(np.asarray(of).tobytes() for of in links), num_slots)
    if key not in PLANNED:
        problem = problem_of(links, settings, is_certain=not links.is_doubtful)
        nothing = np.zeros(links.received_mw.shape, dtype=np.float32)
        PLANNED[key] = scheduled(nothing, 0.0, problem, [True] * num_slots)
    return PLANNED[key]


def cut_off(mission, robots, windows, *, is_mute=True, is_deaf=True):
    """The mission's radio, but in these windows no other robot hears these, nor they any other."""
    radio, is_cut, num_calls = radio_of(mission), np.zeros(mission.num_robots, dtype=bool), 0
    is_cut[robots] = True

    def channel(position_m, recipient):
        nonlocal num_calls
        window, num_calls = num_calls // 2, num_calls + 1
        heard = radio(position_m, recipient)
        if window in windows:
            is_lost = (is_cut[heard] & ~is_cut & is_mute) | (~is_cut[heard] & is_cut & is_deaf)
            heard = np.where(is_lost, np.arange(mission.num_robots), heard)
        return heard

    return channel


def transmitters(swarm, policy, num_windows):
    """Flies on; who transmitted in each slot [slot, mission, robot]."""
    slots = []
    for _ in range(num_windows):
        swarm.step(policy)
        silence = np.arange(swarm.mission.num_robots)
        slots += [phase.recipient != silence for phase in swarm.phases]
    return np.array(slots)


def rows(buffers, i):
    """Robot i's own T, positions and velocities; a known start is a moment after T_0."""
    seen = np.maximum(buffers.timestamp[0, i], np.where(buffers.is_granted[0], 1e-300, 0.0))
    return [seen, buffers.position_m[0, i].copy(), buffers.velocity_mps[0, i].copy()]


class Flight(BroadcastPolicy):
    """A policy that flies one mission; minds, if any, must decide the same throughout."""

    def __init__(self, policy, mission, seed, *, channel=None, minds=()):
        self.policy, self.mission, self.minds = policy, mission, minds
        self.swarm = Swarm(mission, [seed], channel=channel)

    @property
    def team(self):
        return self.policy.teams[0]

    def start(self, num_robots, rngs):
        self.policy.start(num_robots, rngs)

    def transmits(self, views):
        decided = self.policy.transmits(views)
        if views.phases:
            self.converse(views.phases[-1].heard[0].tolist())
        slot = round(2 * float(views.now[0]))
        for mind in self.minds:
            assert decided[0, mind.me] == self.asked(mind, views, slot), (slot, mind.me)
        return decided

    def asked(self, mind, views, slot):
        """What a mind decides on its own row."""
        return mind.transmits(rows(views.buffers, mind.me), slot)

    def converse(self, heard):
        """One slot: all packets are written, then everyone reads the one it decoded."""
        packets = [mind.packet() for mind in self.minds]
        for mind in self.minds:
            sender = heard[mind.me]
            mind.hear(*((None, None) if sender == mind.me else (sender, packets[sender])))

    def fly(self, num_windows):
        """Flies on, and returns who transmitted in each of these slots."""
        return transmitters(self.swarm, self, num_windows)[:, 0]

    @property
    def num_taken(self):
        return sum(mind.took_over for mind in self.minds)


def planner_flight(mission, seed, *, settings=SETTINGS, **rest):
    """A flight of a planner of moving teams."""
    return Flight(Planner(mission, settings), mission, seed, **rest)


def witnessed(mission, seed, *, settings=SETTINGS, **rest):
    """The same beside minds that share nothing but packets."""
    order, rounds = common_orders(seed, mission)
    groups = [group for groups in rounds for group in groups]
    minds = [
        Mind(me=i, mission=mission, settings=settings, order=order, groups=groups)
        for i in range(mission.num_robots)
    ]
    return planner_flight(mission, seed, settings=settings, minds=minds, **rest)
