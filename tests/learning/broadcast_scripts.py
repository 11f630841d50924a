"""Missions of broadcasts that are written down slot by slot."""

import numpy as np

from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.simulation.swarm import Swarm


class Scripted(BroadcastPolicy):
    """Transmits as written, and keeps T before each slot [slots]."""

    def __init__(self, script):
        self.script, self.observed = script, []

    def transmits(self, views):
        self.observed.append(in_slots(views.buffers.timestamp))
        return self.script[len(self.observed) - 1]


def in_slots(timestamp):
    return np.round(2 * timestamp).astype(np.int32)


def flown(mission, seeds, script, channel_rngs=None):
    """T before each slot and at the end, and whom everyone decoded.

    `script[s, b, i]` is whether robot i of mission b transmits in slot s. Generators for the
    channel, one per mission, stand in for the missions' own.
    """
    swarm, policy, heard = Swarm(mission, list(map(int, seeds))), Scripted(script), []
    if channel_rngs is not None:
        swarm.channel.start(mission.num_robots, channel_rngs)
    for _ in range(len(script) // 2):
        swarm.step(policy)
        heard += [phase.heard.copy() for phase in swarm.phases]
    return np.stack([*policy.observed, in_slots(swarm.buffers.timestamp)]), np.stack(heard)
