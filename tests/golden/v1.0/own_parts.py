"""Parts of a user's own, written as 1.0.0's documentation has them."""

import mujoco
import numpy as np

from swarm_mj import BroadcastPolicy, DecentralisedPolicy
from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.policies.gnn.graphs import FeatureExtractor, Graphs
from swarm_mj.radio.mission_radio import radio_of


class AskTheStalest(DecentralisedPolicy):
    """Each robot in turn addresses the teammate whose information is oldest."""

    def recipients(self, views):
        stalest = np.argmin(views.buffers.timestamp, axis=2)
        turn = (views.now % views.num_robots)[:, None]
        return np.where(np.arange(views.num_robots) == turn, stalest, views.silence)


class Csma(BroadcastPolicy):
    """Transmit with a probability, but not right after decoding a packet."""

    def __init__(self, probability=0.3):
        self.probability = probability

    @property
    def parameters(self):
        return {"probability": self.probability}

    def start(self, num_robots, rngs):
        self.draws = Stream(rngs, uniform, (num_robots,))

    def transmits(self, views):
        wants = self.draws.next() < self.probability
        return wants & (views.phases[-1].heard == views.silence) if views.phases else wants


class Lossy:
    """Free space, but each robot misses 30 % of what it would decode."""

    def __init__(self, mission):
        self.radio = radio_of(mission)

    def start(self, num_robots, rngs):
        self.draws = Stream(rngs, uniform, (num_robots,))

    def __call__(self, position_m, recipient):
        heard = self.radio(position_m, recipient)
        return np.where(self.draws.next() < 0.3, np.arange(heard.shape[1]), heard)


class Gather:
    """Each robot moves to the mean of the positions it knows."""

    cost_name, cost_unit = "spread of the team", "m"

    def __call__(self, buffers, states):
        known = buffers.is_known[..., None]
        mean_m = (buffers.position_m * known).sum(axis=2) / np.maximum(1, known.sum(axis=2))
        return 0.1 * (mean_m - states.position_m) - states.velocity_mps

    def cost(self, states):
        return np.std(states.position_m, axis=1).mean(axis=1)


def wall(spec, mission):
    """A wall 10 m thick through the middle, with gaps at both ends."""
    size_m = [5.0, 0.3 * mission.side_m, 5.0]
    box = mujoco.mjtGeom.mjGEOM_BOX
    spec.worldbody.add_geom(name="wall", type=box, size=size_m, pos=[0.0, 0.0, 5.0])


class Ages(FeatureExtractor):
    """The age of what a robot knows of each teammate, and which of them it is itself."""

    names = ("age", "is oneself")

    def graphs(self, views):
        buffers, n = views.buffers, views.num_robots
        age = (views.now[:, None, None] - buffers.timestamp) / self._mission.num_windows
        node = np.stack([age, np.broadcast_to(np.eye(n), age.shape)], axis=-1)
        rows = node.reshape(-1, n, 2).astype(np.float32)
        everyone, no_turns = np.ones(rows.shape[:2], bool), np.zeros(len(rows), bool)
        parent = buffers.parent.reshape(-1, n)
        return Graphs(node=rows, parent=parent, may_address=everyone, has_turn=no_turns)
