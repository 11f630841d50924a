"""Missions flown by a residual policy, with the advantage of each of its decisions."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32

from residual_gnn.counterfactual import RecordedMissions, counterfactual_advantage
from residual_gnn.features import Seen
from residual_gnn.policy import Decision, ResidualPolicy, ticks
from swarm_mj.mission.batched_rng import Started
from swarm_mj.protocol.buffers import BROADCAST
from swarm_mj.protocol.timestamps import SLOT_WINDOWS, SLOTS_PER_WINDOW
from swarm_mj.protocol.window import LocalViews, channel_at
from swarm_mj.simulation.swarm import Swarm

LIKELY = 0.02  # above it, a decision that may go otherwise than the rule is always used


class TrainingBatch(NamedTuple):
    """R decisions with their advantages, and E neighbours in all."""

    seen: Seen
    logit: Float32[np.ndarray, "R"]  # of transmitting, when it was decided
    weight: Float32[np.ndarray, "R"]  # how many decisions each stands for
    advantage: Float32[np.ndarray, "R"]  # of transmitting over silence, mean over pairs [slots²]


class _Part(NamedTuple):
    """Of a lesson: one slot's, with R decisions, of which C are learned from."""

    decision: Decision
    chosen: Bool[np.ndarray, "R"]
    weight: Float[np.ndarray, "C"]
    advantage: Float[np.ndarray, "C"]  # as `TrainingBatch.advantage`


class Recorder(ResidualPolicy):
    """A policy that keeps all its decisions, and what robots knew before each."""

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Forget what was kept; arguments as in `Policy.start`."""
        super().start(num_robots, rngs)
        self.decisions: list[Decision] = []
        self.observed: list[np.ndarray] = []  # T before each slot [ticks]

    def decide(self, views: LocalViews) -> Decision:
        """Return the decision, and keep it."""
        decision = super().decide(views)
        seen = decision.seen  # of a room for many more neighbours
        decision = decision._replace(seen=seen._replace(neighbours=seen.neighbours.copy()))
        self.decisions.append(decision)
        self.observed.append(ticks(views.buffers.timestamp))
        return decision


def collect_batch(
    swarm: Swarm, policy: Recorder, rng: np.random.Generator, *, share: float, horizon: int
) -> tuple[TrainingBatch, float]:
    """Fly missions to their end, and compute the advantage of their decisions.

    Args:
        swarm: Of missions that have just begun.
        policy: That decides.
        rng: Draws which decisions are learned from, and the channel's own numbers if it has any, so
            that the same places are not flown twice alike there. The policy's numbers are the
            mission's.
        share: Of the decisions that are learned from, where robots hardly thought of doing
            otherwise than the rule.
        horizon: Slots over which a packet's advantage is counted; decisions closer to the end
            than half of it are left out.

    Returns:
        What there is to learn, and the mean age of information [windows].
    """
    num_missions, num_robots = swarm.buffers.shape
    if isinstance(swarm.channel, Started):
        swarm.channel.start(num_robots, rng.spawn(num_missions))
    positions_m, heard, ages, active = [], [], [], []
    for _ in range(swarm.mission.num_windows):
        ages.append(np.mean(swarm.step(policy).age_windows))
        states = swarm.states
        positions_m.append(states.position_m.copy())
        active.append(states.is_active)
        heard += [phase.heard.copy() for phase in swarm.phases]
    last = ticks(swarm.buffers.timestamp)
    recorded = RecordedMissions(np.stack([*policy.observed, last]), np.stack(heard))
    num_slots = len(policy.decisions) - horizon // 2
    parts = []
    for s, decision in enumerate(policy.decisions[:num_slots]):
        window = s // SLOTS_PER_WINDOW
        chosen, weight = _learned_from(decision, rng, share)
        rows = decision.rows[chosen]
        otherwise = decision.transmits[rows[:, 0]]
        place = np.arange(len(rows)), rows[:, 1]
        did = otherwise[place]
        otherwise[place] = ~did
        is_active = active[window]
        if is_active is not None:
            otherwise &= is_active[rows[:, 0]]
        channel = channel_at(swarm.channel, np.full(len(rows), (s + 1) * SLOT_WINDOWS), rows[:, 0])
        recipient = np.where(otherwise, BROADCAST, np.arange(num_robots))
        decoded = channel(positions_m[window][rows[:, 0]], recipient)
        if is_active is not None:
            decoded = np.where(is_active[rows[:, 0]], decoded, np.arange(num_robots))
        saved = np.empty(len(rows))
        counterfactual_advantage(
            recorded, np.full(len(rows), s), rows[:, 0], decoded, horizon, saved
        )
        saved = np.where(did, -saved, saved) / num_robots**2
        parts.append(_Part(decision, chosen, weight, saved))
    return _joined(parts), float(np.mean(ages))


def _learned_from(
    decision: Decision, rng: np.random.Generator, share: float
) -> tuple[Bool[np.ndarray, "R"], Float[np.ndarray, "C"]]:
    """Return which decisions are learned from, and how many each of those stands for."""
    rows = decision.rows[:, 0], decision.rows[:, 1]
    proposed, did = decision.proposal.transmits[rows], decision.transmits[rows]
    is_sure = proposed | did | (decision.logit > np.log(LIKELY / (1.0 - LIKELY)))
    chosen = is_sure | (rng.random(len(is_sure)) < share)
    return chosen, np.where(is_sure, 1.0, 1.0 / share)[chosen]


def _joined(parts: Sequence[_Part]) -> TrainingBatch:
    """Return the decisions of all slots in one."""
    robots, neighbours, owners, start = [], [], [], 0
    for part in parts:
        seen, chosen = part.decision.seen, part.chosen
        place = np.cumsum(chosen) - 1
        is_kept = chosen[seen.owner]
        robots.append(seen.robots[chosen])
        neighbours.append(seen.neighbours[is_kept])
        owners.append(start + place[seen.owner[is_kept]])
        start += int(np.count_nonzero(chosen))
    single = np.float32
    return TrainingBatch(
        Seen(np.concatenate(robots), np.concatenate(neighbours), np.concatenate(owners)),
        np.concatenate([part.decision.logit[part.chosen] for part in parts]),
        np.concatenate([part.weight for part in parts]).astype(single),
        np.concatenate([part.advantage for part in parts]).astype(single),
    )
