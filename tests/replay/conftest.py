"""A short flight with every kind of packet, for the replay's tests."""

from dataclasses import dataclass

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.packet_counts import Packets
from swarm_mj.replay.log import Log
from swarm_mj.replay.recorder import Recorder
from swarm_mj.replay.write import write_replay
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm


@dataclass(frozen=True)
class Recorded:
    """A log, and the packets as the costs count them, per window."""

    log: Log
    packets: list[Packets]

    def counted(self, fate: str) -> np.ndarray:
        """How many packets of a fate each window had, by the costs."""
        return np.array([getattr(packets, fate)[0] for packets in self.packets])


WALK = {"task": "random-walk", "velocity_ratio": 0.6, "num_robots": 14}
FLIGHTS = {
    "two_way": ("mst", 0.3, {}),  # Alg. 1, busy enough that packets of all fates occur
    "flooded": ("random-flooding", 0.2, {}),  # windows of two transmissions
    "still": ("mst", 0.3, {"task": "stationary"}),
    "failing": ("mst", 0.3, {"failure_fraction": 0.25}),  # 3 of 12 robots, after 15 windows
    # Robots that run between city blocks, under shadowing: some get cut off from the others.
    "blocked": ("random-flooding", 0.2, {"arena": "blocks", "shadowing_db": 6.0, **WALK}),
    # Bodies at several heights, which tilt as they fly.
    "high": ("mst", 0.3, {"robot": "quadrotor:10,rover:2", "height_range_m": 60.0}),
    "long": ("mst", 0.3, {"num_robots": 40, "num_windows": 500, "boundary": "none"}),
}


def flown(name):
    @pytest.fixture(scope="session", name=name)
    def flight():
        policy_name, probability, its = FLIGHTS[name]
        settings = {"num_robots": 12, "num_windows": 30, "boundary": "reflect", **its}
        mission = paper(settings.pop("task", "flocking"), **settings)
        swarm = Swarm(mission, [5])
        recorder, packets = Recorder(swarm, ego=4), []
        for window in rollout(swarm, make_policy(policy_name, mission, probability)):
            recorder.add(window)
            packets.append(window.costs.packets)
        return Recorded(recorder.log({"policy": "mst", "seed": 5}), packets)

    return flight


def written(name, flight, **config):
    @pytest.fixture(scope="session", name=name)
    def replay(request, tmp_path_factory):
        path = tmp_path_factory.mktemp("r") / "a.rrd"
        write_replay(request.getfixturevalue(flight).log, {"seed": 5, **config}, path)
        return path

    return replay


two_way, flooded, still, failing, blocked, high, long = map(flown, FLIGHTS)
replay = written("replay", "two_way", policy="mst", ratio=0.25)
flood_replay = written("flood_replay", "flooded")
blocked_replay = written("blocked_replay", "blocked")
still_replay = written("still_replay", "still")
high_replay = written("high_replay", "high")
