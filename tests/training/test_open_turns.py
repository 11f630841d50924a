"""Open turns, robot by robot in a plain loop: who owns one, who joins it, and who is silent."""

import math

import numpy as np

from swarm_mj.mission import paper
from swarm_mj.simulation.swarm import Swarm
from training.examples import open_turns
from training.examples.open_turns import OpenTurns

NUM_ROBOTS = 10


class Seen(OpenTurns):
    """Notes what the index alone asks for in each slot, what is asked for, and T at that time."""

    def __init__(self, mission):
        super().__init__(mission)
        self.slots = []

    def _by_index(self, views, slot):
        alone = super()._by_index(views, slot)
        is_in_a_hurry = views.silence % 2 == 0  # would begin as early as a turn's owner
        self.alone = alone._replace(minislot=np.where(is_in_a_hurry, 0.0, alone.minislot))
        return self.alone

    def contend(self, views):
        asked = super().contend(views)
        known = views.buffers.timestamp[0].tolist()
        self.slots.append((float(views.now[0]), known, self.alone, asked))
        return asked


def test_a_robot_joins_a_turn_after_its_owner_unless_it_misses_someone(monkeypatch):
    monkeypatch.setattr(open_turns, "LOST_AFTER", 0.5)  # so that some miss someone: 5 windows
    mission = paper("random-walk", num_robots=NUM_ROBOTS)
    policy = Seen(mission)
    swarm = Swarm(mission, [1])
    swarm.start(policy)
    for _ in range(40):
        swarm.step()
    num = {"owner": 0, "joins": 0, "closed": 0}
    for slot, (now, known, alone, asked) in enumerate(policy.slots):
        for i in range(NUM_ROBOTS):
            begins, busy_dbm = asked.minislot[0, i], asked.busy_dbm[0, i]
            by_index = alone.minislot[0, i], alone.busy_dbm[0, i]
            if slot % 4 != 3:
                assert (begins, busy_dbm) == by_index
            elif i == slot // 4 % NUM_ROBOTS:
                num["owner"] += 1
                assert (begins, busy_dbm) == (0.0, math.inf)
            elif any(now - t > 5.0 for t in known[i]):
                num["closed"] += 1
                assert begins == math.inf
            else:
                num["joins"] += 1
                assert begins == max(by_index[0], 1.0)
                assert busy_dbm == by_index[1] - 3.0
    assert all(times > 10 for times in num.values()), num
