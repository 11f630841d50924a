"""Residual policies: a rule proposes who transmits, and a network corrects it.

Residual reinforcement learning (Silver et al. 2018, Johannink et al. 2019) for the slots of a
shared channel. The rule is one that robots agree on without a word. It cannot know what the channel
did to their packets. The network sees what its robot remembers of every neighbour, and may transmit
where the rule would not, or keep silent where it would.
"""

import hashlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Int32

from residual_gnn.features import Seen, room_to_see, see
from residual_gnn.memory import empty_memory, note_slot
from residual_gnn.network import Weights
from residual_gnn.rule import Proposal, RestingRule
from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.policies.policy import BroadcastPolicy, Parameters
from swarm_mj.policies.tdma import slot_of
from swarm_mj.protocol.timestamps import SLOTS_PER_WINDOW
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.mission_radio import Belief

DIGITS = 12  # of a digest: enough to tell policies apart


class Decision(NamedTuple):
    """The decision on one slot of the R robots that might do otherwise than the rule."""

    rows: Int[np.ndarray, "R 2"]  # mission and identity of each
    seen: Seen
    logit: Float32[np.ndarray, "R"]  # of transmitting
    proposal: Proposal
    transmits: Bool[np.ndarray, "B N"]


class ResidualPolicy(BroadcastPolicy):
    """A policy that draws whether to transmit by the network's probability, given the plan.

    Uses the robot's own buffer, T in packets that it decoded, its identity, the team's size, the
    order, the clock, common random numbers and the radio's range and threshold. Of what the mission
    grants of the channel it uses what `planner --payload none` uses.
    """

    def __init__(
        self,
        weights: Weights,
        rule: RestingRule,
        radio: FreeSpaceRadio,
        *,
        is_deterministic: bool = False,
        reads_packets: bool = True,
    ) -> None:
        """Prepare the policy.

        Args:
            weights: The network's.
            rule: That proposes.
            radio: What robots believe in unless the policy is informed otherwise.
            is_deterministic: Whether robots transmit when it is likelier than not, without a draw.
            reads_packets: Whether packets hold all of T as it was before the slot, so that they
                tell what their senders know.
        """
        self.uses = (
            f"{rule.uses}, which a trained graph neural network corrects by what the robot "
            "remembers of its neighbours and of its own packets"
        )
        self._weights, self._rule, self._radio = weights, rule, radio
        self._is_deterministic, self._reads_packets = is_deterministic, reads_packets
        self._belief = Belief(radio=radio)

    @property
    def parameters(self) -> Parameters:
        """Whether it draws, and a digest that changes with its network."""
        weights = self._weights
        digest = hashlib.sha256(repr((weights.prior_logit, weights.corrects_turns)).encode())
        for name, array in sorted(weights.arrays.items()):
            digest.update(name.encode() + b"\0" + np.ascontiguousarray(array).tobytes())
        hexadecimal = digest.hexdigest()[:DIGITS]
        return {"is_deterministic": self._is_deterministic, "digest": hexadecimal}

    def inform(self, belief: Belief) -> None:
        """Take the powers that robots believe in."""
        self._belief = belief
        self._rule.inform(belief)

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draw each mission's order and forget; arguments as in `Policy.start`."""
        self._rule.start(num_robots, rngs)
        self._own = Stream(rngs, uniform, (num_robots,))
        self._common = Stream(rngs, uniform, (num_robots,))
        self._beliefs = empty_memory(len(rngs), num_robots)
        self._law = self._belief.law_over_noise(num_robots)
        self._last: Decision | None = None

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return which robots transmit, by the network."""
        return self.decide(views).transmits

    def decide(self, views: LocalViews) -> Decision:
        """Decide on the slot that begins, and return the decision with its inputs."""
        buffers, tick = views.buffers, 1 + slot_of(views.now)
        observed = ticks(buffers.timestamp)
        is_known, threshold = buffers.is_known, self._radio.threshold
        if self._last is not None:
            note_slot(
                self._beliefs,
                tick - 1,
                observed,
                is_known,
                buffers.position_m,
                self._last.proposal.is_due,
                self._last.transmits,
                views.phases[-1].heard if self._reads_packets else views.silence,
                self._law,
                threshold,
            )
        proposal = self._rule.propose(views)
        rows = np.argwhere(proposal.is_agreed | self._weights.corrects_turns)
        room = room_to_see(len(rows), views.num_robots)
        count = see(
            rows,
            tick,
            self._beliefs,
            observed,
            is_known,
            buffers.position_m,
            proposal,
            self._common.next(),
            self._law,
            threshold,
            room,
        )
        seen = Seen(room.robots, room.neighbours[:count], room.owner[:count])
        logit = self._weights.logits(seen)
        place = rows[:, 0], rows[:, 1]
        likely = 0.5 if self._is_deterministic else self._own.next()[place]
        transmits = proposal.transmits.copy()
        transmits[place] = 1.0 / (1.0 + np.exp(-logit.astype(np.float64))) > likely
        self._last = Decision(rows, seen, logit, proposal, transmits)
        return self._last


def ticks(timestamp: Float[np.ndarray, "..."]) -> Int32[np.ndarray, "..."]:
    """Return a time [windows] in slots."""
    return np.rint(SLOTS_PER_WINDOW * timestamp).astype(np.int32)
