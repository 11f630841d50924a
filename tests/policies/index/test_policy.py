"""Flights of `index-csma`: what a robot's choice depends on, and teams of all sizes."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.carrier_sense import TURN_EVERY
from swarm_mj.policies.index.policy import IndexCsma
from swarm_mj.policies.index.weights import START, flat, from_flat
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.buffers import Buffers
from swarm_mj.protocol.window import Phase
from swarm_mj.simulation.swarm import Swarm

WALK = paper("random-walk", num_robots=20)
MINE = 5  # the robot whose choices are looked at


class Doubted(IndexCsma):
    """Chooses twice: as it is, and after all that `MINE` cannot know was replaced by anything."""

    def __init__(self, mission, weights):
        super().__init__(mission, weights)
        self.seen = []
        self._doubts = np.random.default_rng(4)

    def contend(self, views):
        heard = views.phases[-1].heard[0, MINE] if views.phases else MINE
        others = np.setdiff1d(np.arange(20), [MINE])
        unheard = np.setdiff1d(others, [heard])  # T of the one that was decoded was in its packet
        again = self._doubted(others, unheard).contend(self._other_views(views, others, unheard))
        once = super().contend(views)
        self.seen.append([[each[0, MINE] for each in both] for both in (once, again)])
        return once

    def _doubted(self, others, unheard):
        other = IndexCsma(WALK, START)
        for name, value in vars(self).items():
            if name not in ("_sensing", "seen", "_doubts"):
                setattr(other, name, copy.deepcopy(value))
        for values in (*other._table, *other._record):
            if values.ndim > 1 and values.dtype.kind == "f":
                self._replace(values, others)
        for values in (other._before, other._packet, other._earlier, other._last_sent):
            if values is not None:
                self._replace(values, unheard)
        return other

    def _other_views(self, views, others, unheard):
        buffers, phases = copy.deepcopy((views.buffers, views.phases))
        self._replace(buffers.timestamp, others)
        self._replace(buffers.position_m, others)
        for phase in phases:
            phase.heard[:, others] = self._doubts.integers(0, 20, (1, 19))
            phase.recipient[:, unheard] = self._doubts.integers(-1, 20, (1, len(unheard)))
        return replace(views, buffers=buffers, phases=phases)

    def _replace(self, values, robots):
        values[:, robots] = self._doubts.uniform(0, 50, values[:, robots].shape)


@pytest.mark.parametrize("bit_rate", [None, 30_000.0])
def test_a_robot_begins_by_what_has_reached_it_alone(bit_rate):
    mission = replace(WALK, bit_rate=bit_rate)
    policy = Doubted(mission, START)
    swarm = Swarm(mission, [1])
    swarm.start(policy)
    for _ in range(60):
        swarm.step()
    assert all(once == again for once, again in policy.seen)
    assert len({tuple(once) for once, _ in policy.seen}) > 20


class Draws:
    """Numbers that are given, in place of a stream's."""

    def next(self):
        return self.draw


class Renumbered(IndexCsma):
    """Chooses also as robots with other identities would, and compares."""

    def __init__(self, mission, weights):
        super().__init__(mission, weights)
        self.differs = []
        self._order = np.random.default_rng(2).permutation(mission.num_robots)
        self._other = IndexCsma(mission, weights)

    def start(self, num_robots, rngs):
        super().start(num_robots, rngs)
        self._other.start(num_robots, rngs)
        self._drawn = self._uniform
        self._uniform, self._other._uniform = Draws(), Draws()

    def contend(self, views):
        draw = self._drawn.next().copy()
        self._uniform.draw = draw
        self._other._uniform.draw = np.ascontiguousarray(draw[:, :, self._order])
        once = super().contend(views)
        again = self._other.contend(self._other_views(views))
        # Turns follow identities.
        if int(2 * views.now[0]) % TURN_EVERY != TURN_EVERY - 1:
            for mine, others in zip(once, again, strict=True):
                self.differs.append(np.abs(mine[:, self._order] - others) > 1e-6)
        return once

    def _other_views(self, views):
        buffers = {}
        for name, values in vars(views.buffers).items():
            moved = values if values.ndim == 1 else values[:, self._order][:, :, self._order]
            buffers[name] = np.ascontiguousarray(moved)
        phases = tuple(
            Phase(self._renumbered(phase.recipient), self._renumbered(phase.heard))
            for phase in views.phases
        )
        return replace(views, buffers=Buffers(**buffers), phases=phases)

    def _renumbered(self, robots):
        """The same robots, by their other numbers; negative ones are none."""
        moved = robots[:, self._order]
        return np.where(moved >= 0, np.argsort(self._order)[moved], moved)


def test_robots_with_other_identities_choose_the_same():
    """Sums are rounded in another order, which is seldom a minislot more or less."""
    policy = Renumbered(WALK, START)
    swarm = Swarm(WALK, [1])
    swarm.start(policy)
    with np.errstate(invalid="ignore"):  # infinite less infinite, which are equal
        for _ in range(40):
            swarm.step()
    assert len(policy.differs) > 100
    assert np.mean(policy.differs) < 0.005


@pytest.mark.parametrize("num_robots", [2, 3, 5, 60])
def test_teams_of_all_sizes_come_to_know_everyone(num_robots):
    mission = paper("stationary", num_robots=num_robots, num_windows=200)
    swarm = Swarm(mission, range(2**41, 2**41 + 3))
    swarm.start(make_policy("index-csma", mission))
    for _ in range(200):
        swarm.step()
    knows = swarm.buffers.is_known | np.eye(num_robots, dtype=bool)
    assert np.all(knows)


def test_several_rows_of_numbers_fly_side_by_side_as_they_would_alone():
    both = from_flat(np.concatenate([flat(START), flat(START) * 0.8]))
    ages = []
    for weights, seeds in ((both, [1, 2, 1, 2]), (from_flat(flat(START) * 0.8), [1, 2])):
        swarm = Swarm(WALK, seeds)
        swarm.start(IndexCsma(WALK, weights))
        ages.append([swarm.step().age_windows for _ in range(40)][-1])
    assert ages[0][2:].tolist() == ages[1].tolist()
    assert ages[0][:2].tolist() != ages[1].tolist()


@pytest.mark.parametrize("minislots", [1, 16, 64])
def test_robots_begin_in_minislots_that_there_are(minislots):
    mission = paper("stationary", num_robots=12, minislots=minislots)
    asked = []

    class Seen(IndexCsma):
        def contend(self, views):
            contention = super().contend(views)
            asked.append(contention.minislot)
            return contention

    swarm = Swarm(mission, [1])
    swarm.start(Seen(mission, START))
    for _ in range(30):
        swarm.step()
    begun = np.concatenate(asked).ravel()
    begun = begun[np.isfinite(begun)]
    assert set(begun) <= set(range(minislots))
    assert len(set(begun)) > min(minislots, 10) - 1


def test_a_digest_tells_numbers_apart():
    """Results keep it, so that rows of two trainings are not taken for one policy's."""
    first = IndexCsma(WALK, START).parameters
    assert first == IndexCsma(WALK, START).parameters
    assert first != IndexCsma(WALK, START._replace(first=START.first + 1e-3)).parameters


def test_a_flight_in_which_robots_fail_goes_on():
    mission = paper("random-walk", num_robots=12, num_windows=80, failure_fraction=0.5)
    swarm = Swarm(mission, [1, 2])
    swarm.start(make_policy("index-csma", mission))
    ages = [swarm.step().age_windows for _ in range(80)]
    assert np.all(np.isfinite(ages))
