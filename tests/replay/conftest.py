"""A short flight with every kind of packet, for the replay's tests."""

from dataclasses import dataclass

import numpy as np
import pytest

from swarm_mj.mission import Mission, paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.costs import Packets
from swarm_mj.replay.recorder import Log, Recorder
from swarm_mj.replay.write import write_replay
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm


@dataclass(frozen=True)
class Recorded:
    """A log, its mission, and the packets as the costs count them, per window."""

    log: Log
    mission: Mission
    packets: list[Packets]

    def counted(self, fate: str) -> np.ndarray:
        """How many packets of a fate each window had, by the costs."""
        return np.array([getattr(packets, fate)[0] for packets in self.packets])


def record(policy_name, probability, *, task="flocking", **overrides):
    settings = {"num_robots": 12, "num_windows": 30, "boundary": "reflect"} | overrides
    mission = paper(task, **settings)
    swarm = Swarm(mission, [5])
    policy = make_policy(policy_name, mission, probability)
    recorder = Recorder(swarm, ego=4)
    packets = []
    for window in rollout(swarm, policy):
        recorder.add(window)
        packets.append(window.costs.packets)
    return Recorded(recorder.log(), mission, packets)


@pytest.fixture(scope="session")
def long():
    """A busy flight of the default size."""
    return record("mst", 0.3, num_robots=40, num_windows=500, boundary="none")


@pytest.fixture(scope="session")
def two_way():
    """Windows of Alg. 1, busy enough that packets of all fates occur."""
    return record("mst", 0.3)


@pytest.fixture(scope="session")
def flooded():
    """Windows of two transmissions."""
    return record("random-flooding", 0.2)


@pytest.fixture(scope="session")
def still():
    """A team at rest."""
    return record("mst", 0.3, task="stationary")


@pytest.fixture(scope="session")
def failing():
    """Of 12 robots 3 are switched off after 15 of 30 windows."""
    return record("mst", 0.3, failure_fraction=0.25)


@pytest.fixture(scope="session")
def blocked():
    """Robots that run between city blocks, under shadowing: some get cut off from the others."""
    walk = {"task": "random-walk", "velocity_ratio": 0.6, "num_robots": 14}
    return record("random-flooding", 0.2, arena="blocks", shadowing_db=6.0, **walk)


def written(recorded, folder, **config):
    path = folder.mktemp("replays") / "mission.rrd"
    write_replay(recorded.log, recorded.mission, {"seed": 5, **config}, path)
    return path


@pytest.fixture(scope="session")
def replay(two_way, tmp_path_factory):
    return written(two_way, tmp_path_factory, policy="mst", ratio=0.25)


@pytest.fixture(scope="session")
def flood_replay(flooded, tmp_path_factory):
    return written(flooded, tmp_path_factory)


@pytest.fixture(scope="session")
def blocked_replay(blocked, tmp_path_factory):
    return written(blocked, tmp_path_factory)


@pytest.fixture(scope="session")
def still_replay(still, tmp_path_factory):
    return written(still, tmp_path_factory)
