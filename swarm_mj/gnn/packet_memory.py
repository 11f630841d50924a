"""What a robot remembers of the packets that it sent and decoded, beside its buffer.

Every robot's memory is its own: row `[b, i]` is written from what robot `i` sent and decoded only.
"""

import numpy as np
from jaxtyping import Float, Float32, Int

from swarm_mj.compiled import compiled
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.protocol.timestamps import merge_timestamps, observe_own
from swarm_mj.protocol.window import SLOT_WINDOWS


class Memory:
    """When each robot last heard, addressed and was addressed by whom, and what packets said.

    A packet's timestamps are its sender's at that time. They are followed from window to window
    here, by Alg. 1: who decoded a packet saw them.
    """

    heard: Float32[np.ndarray, "B N N"]  # when i last decoded a packet of k itself [windows]
    addressed_by: Float32[np.ndarray, "B N N"]  # when such a packet was last meant for i [windows]
    sent: Float32[np.ndarray, "B N"]  # when i last spoke first [windows]
    neighbour: Float32[np.ndarray, "B N N N"]  # T^{k,j} in the last packet of k that i decoded
    said: Float32[np.ndarray, "B N N"]  # T^{i,j} when i last spoke first [windows]

    def __init__(self, num_missions: int, num_robots: int) -> None:
        """Begins empty: nothing was ever heard or said."""
        pairs = (num_missions, num_robots, num_robots)
        self.heard = np.full(pairs, NEVER, dtype=np.float32)
        self.addressed_by = np.full(pairs, NEVER, dtype=np.float32)
        self.sent = np.full(pairs[:2], NEVER, dtype=np.float32)
        self.neighbour = np.full((*pairs, num_robots), NEVER, dtype=np.float32)
        self.said = np.full(pairs, NEVER, dtype=np.float32)
        self._before = np.full(pairs, NEVER, dtype=np.float32)  # T when the last window began

    def update(self, views: LocalViews) -> None:
        """Takes in the window that has just ended; must see every window.

        Args:
            views: At the end of a window of transmission and response, or at the start.
        """
        if views.phases:
            transmission, response = views.phases
            for phase, time in ((transmission, views.now - SLOT_WINDOWS), (response, views.now)):
                _take_in(
                    phase.recipient,
                    phase.heard,
                    time,
                    phase is transmission,
                    self._before,
                    self.heard,
                    self.addressed_by,
                    self.sent,
                    self.neighbour,
                    self.said,
                )
        self._before[...] = views.buffers.timestamp


@compiled()
def _take_in(
    recipient: Int[np.ndarray, "B N"],
    heard_from: Int[np.ndarray, "B N"],
    time: Float[np.ndarray, "B"],
    is_transmission: bool,
    timestamp: Float32[np.ndarray, "B N N"],
    heard: Float32[np.ndarray, "B N N"],
    addressed_by: Float32[np.ndarray, "B N N"],
    sent: Float32[np.ndarray, "B N"],
    neighbour: Float32[np.ndarray, "B N N N"],
    said: Float32[np.ndarray, "B N N"],
) -> None:
    """One phase: what was said, who decoded it, and `timestamp` merged as the buffers were."""
    num_missions, num_robots = recipient.shape
    for b in range(num_missions):
        observe_own(timestamp[b], time[b])
        packet = timestamp[b].copy()
        for i in range(num_robots):
            if is_transmission and recipient[b, i] != i:
                sent[b, i] = time[b]
                said[b, i] = packet[i]
            k = heard_from[b, i]
            if k != i:
                heard[b, i, k] = time[b]
                neighbour[b, i, k] = packet[k]
                if recipient[b, k] == i:
                    addressed_by[b, i, k] = time[b]
        merge_timestamps(packet, heard_from[b], timestamp[b])
