"""The counterfactual advantage of a packet: the age it removed from the team afterwards.

A recorded mission says who decoded whom in every slot. With one packet more or less, one slot
goes otherwise, and from there on news spreads by the same receptions. So the difference that the
packet made follows exactly, for as long as one likes, under one assumption: all others transmit as
they did. It is the difference reward of `learning/credit.py`, but it looks ahead.

Index order: `[s, b, j, k]` is what robot `j` of mission `b` knows of `k` before slot `s`. Times are
ticks: a slot's tick is its number, counted from 1.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Int32

from swarm_mj.system.compiled import compiled


class RecordedMissions(NamedTuple):
    """B recorded missions of S slots."""

    observed: Int32[np.ndarray, "S+1 B N N"]  # T before each slot, and at the end [ticks]
    heard: Int[np.ndarray, "S B N"]  # whom each robot decoded; itself is nobody


@compiled()
def counterfactual_advantage(
    recorded: RecordedMissions,
    slot: Int[np.ndarray, "R"],
    mission: Int[np.ndarray, "R"],
    heard: Int[np.ndarray, "R N"],
    horizon: int,
    age_saved: Float[np.ndarray, "R"],
) -> None:
    """Fill in how much lower the team's age is if one slot goes otherwise.

    Args:
        recorded: Of the missions as they went.
        slot: Which slot goes otherwise, of each row.
        mission: Of which mission.
        heard: Whom everyone decodes in that slot instead; itself is nobody.
        horizon: Slots that are counted, from that one on.
        age_saved: Sum over slots and pairs of robots, overwritten [slots²].
    """
    num_robots = heard.shape[1]
    other = np.empty((num_robots, num_robots), dtype=np.int32)
    differs = np.empty(num_robots, dtype=np.bool_)
    for r in range(slot.shape[0]):
        s, b = slot[r], mission[r]
        last = min(s + horizon, recorded.heard.shape[0])
        differs[:] = False
        _step(recorded, s, b, heard[r], differs, other)
        age_saved[r] = 0.0
        for t in range(s + 1, last + 1):
            if not np.any(differs):
                break
            for j in range(num_robots):
                if differs[j]:
                    for k in range(num_robots):
                        age_saved[r] += other[j, k] - recorded.observed[t, b, j, k]
            if t < last:
                _step(recorded, t, b, recorded.heard[t, b], differs, other)


@compiled()
def _step(
    recorded: RecordedMissions,
    s: int,
    b: int,
    heard: Int[np.ndarray, "N"],
    differs: Bool[np.ndarray, "N"],
    other: Int32[np.ndarray, "N N"],
) -> None:
    """One slot: `other` holds the rows of robots that know otherwise than they did.

    A robot that transmits decodes nothing, so a sender's row is what its packet holds.
    """
    before, after, went = recorded.observed[s, b], recorded.observed[s + 1, b], recorded.heard[s, b]
    for j in range(heard.shape[0]):
        o = heard[j]
        is_as_it_was = o == went[j] and not differs[j] and (o == j or not differs[o])
        if is_as_it_was:
            continue
        is_other = False
        for k in range(heard.shape[0]):
            known = other[j, k] if differs[j] else before[j, k]
            if o != j:
                # The sender observes itself in the slot.
                sent = after[o, o] if k == o else (other[o, k] if differs[o] else before[o, k])
                known = max(known, sent)
            other[j, k] = after[j, j] if k == j else known
            is_other = is_other or other[j, k] != after[j, k]
        differs[j] = is_other
