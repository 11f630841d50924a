"""The costs of a window (II-C, IV-A): age of information, velocity variance, packets."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import NEVER, Buffers
from swarm_mj.protocol.packet_counts import (
    COUNTS,
    PACKET_COUNTS,
    Packets,
    count_addressed,
    count_broadcasts,
)
from swarm_mj.protocol.window import Phase
from swarm_mj.system.compiled import compiled


def age_of_information(
    buffers: Buffers,
    now: Float[np.ndarray, "B"],
    is_active: Bool[np.ndarray, "B N"] | None = None,
) -> tuple[Float[np.ndarray, "B"], Bool[np.ndarray, "B"]]:
    """Return the mean over all pairs i, j of t - T^{i,j}, own age included (Eq. 10).

    Args:
        buffers: What the robots know.
        now: t, [B], [windows].
        is_active: Whose pairs count, [B N], at least one robot's in each mission; None is all.

    Returns:
        The age, [B], [windows], and whether all robots know all, [B].
    """
    age = np.empty(len(now))
    is_complete = buffers.is_granted.copy()
    _mean_age(buffers.timestamp, now, is_active, age, is_complete)
    return age, is_complete


@compiled()
def velocity_variance(
    velocity_mps: Float[np.ndarray, "B N D"], is_active: Bool[np.ndarray, "B N"] | None = None
) -> Float[np.ndarray, "B"]:
    """Return the velocity variance of the active team, per mission [m²/s²] (Eq. 17)."""
    variance = np.empty(velocity_mps.shape[0])
    for b in range(velocity_mps.shape[0]):
        active_mps = velocity_mps[b] if is_active is None else velocity_mps[b][is_active[b]]
        total = 0.0
        num_active = active_mps.shape[0]
        for axis in range(velocity_mps.shape[2]):
            mean = 0.0
            for i in range(num_active):
                mean += active_mps[i, axis] / num_active
            for i in range(num_active):
                total += (active_mps[i, axis] - mean) ** 2
        variance[b] = total / num_active
    return variance


def mean_hops(
    buffers: Buffers, is_active: Bool[np.ndarray, "B N"] | None = None
) -> Float[np.ndarray, "B"]:
    """Return the mean depth of teammates in the parent trees (II-B), 0 without teammates [hops].

    Depths of active robots in active robots' trees count, through any robot. A state known
    beforehand came over no radio, so has no depth. Raises ValueError if parents form no trees.
    """
    hops = np.empty(buffers.parent.shape[0])
    if not _mean_depth(buffers.timestamp, buffers.parent, is_active, hops):
        raise ValueError("parents of known robots must lead back to the buffer's owner")
    return hops


class CostName(NamedTuple):
    """The name of a task's cost, and its unit."""

    name: str
    unit: str


@dataclass(frozen=True, kw_only=True)
class TaskCost:
    """The cost of the robots' task, as their controller measures it."""

    name: str  # such as "velocity variance"
    unit: str  # such as "m²/s²"
    value: Float[np.ndarray, "B"]


class WindowCosts(NamedTuple):
    """The costs of one window, in every mission."""

    age_windows: Float[np.ndarray, "B"]  # age of information after the window
    is_complete: Bool[np.ndarray, "B"]  # whether all robots know all others
    velocity_variance_m2ps2: Float[np.ndarray, "B"]
    counts: Shaped[np.ndarray, "B"]  # the fates of the packets, as `COUNTS`
    task_cost: TaskCost | None = None  # after the window; None if the controller has none

    @property
    def packets(self) -> Packets:
        """The fates of the packets."""
        return Packets._make(self.counts[name] for name in PACKET_COUNTS)


def window_costs(
    buffers: Buffers,
    states: RobotStates,
    phases: tuple[Phase, ...],
    now: Float[np.ndarray, "B"],
    *,
    is_broadcast: bool,
    task_cost: TaskCost | None = None,
) -> WindowCosts:
    """Return all costs of one window for the active robots.

    Args:
        buffers: What the robots know after the window.
        states: Where they are after it, and who is active.
        phases: Whom they addressed and decoded in its two slots.
        now: t after it, [B], [windows].
        is_broadcast: Whether both slots hold broadcasts, or the second answers the first.
        task_cost: What the robots' own task costs after it, if it has a cost.
    """
    first, second = phases
    num_missions = len(now)
    age = np.empty(num_missions)
    is_complete = buffers.is_granted.copy()
    variance = np.empty(num_missions)
    counts = np.empty(num_missions, COUNTS)
    # All in one call: of a single mission, calls take longer than what they do. The arrays are
    # flat, by name: to take named tuples of them apart would take longer, too.
    _measure(
        timestamp=buffers.timestamp,
        now=now,
        velocity_mps=states.velocity_mps,
        is_active=states.is_active,
        first_recipient=first.recipient,
        first_heard=first.heard,
        second_recipient=second.recipient,
        second_heard=second.heard,
        is_broadcast=is_broadcast,
        age=age,
        is_complete=is_complete,
        variance=variance,
        counts=counts,
    )
    return WindowCosts(
        age_windows=age,
        is_complete=is_complete,
        velocity_variance_m2ps2=variance,
        counts=counts,
        task_cost=task_cost,
    )


# In these, None for `is_active` is compiled apart: without the tests, and as fast as without them.
# Times are halves of a window, so their sum is exact and adding in any order changes nothing.
@compiled(fastmath={"reassoc"})
def _mean_age(
    timestamp: Float[np.ndarray, "B N N"],
    now: Float[np.ndarray, "B"],
    is_active: Bool[np.ndarray, "B N"] | None,
    age: Float[np.ndarray, "B"],
    is_complete: Bool[np.ndarray, "B"],
) -> None:
    for b in range(len(now)):
        active = timestamp[b] if is_active is None else timestamp[b][is_active[b]][:, is_active[b]]
        total = 0.0
        num_unknown = 0
        num_active = active.shape[0]
        for i in range(num_active):
            for j in range(num_active):
                total += active[i, j]
                num_unknown += active[i, j] <= NEVER
        age[b] = now[b] - total / (num_active * num_active)
        is_complete[b] |= num_unknown == 0


@compiled()
def _measure(
    timestamp: Float[np.ndarray, "B N N"],
    now: Float[np.ndarray, "B"],
    velocity_mps: Float[np.ndarray, "B N D"],
    is_active: Bool[np.ndarray, "B N"] | None,
    first_recipient: Int[np.ndarray, "B N"],
    first_heard: Int[np.ndarray, "B N"],
    second_recipient: Int[np.ndarray, "B N"],
    second_heard: Int[np.ndarray, "B N"],
    is_broadcast: bool,
    age: Float[np.ndarray, "B"],
    is_complete: Bool[np.ndarray, "B"],
    variance: Float[np.ndarray, "B"],
    counts: Shaped[np.ndarray, "B"],
) -> None:
    """Fill in all costs, from `age` on."""
    _mean_age(timestamp, now, is_active, age, is_complete)
    by_mission = velocity_variance(velocity_mps, is_active)
    for b in range(variance.shape[0]):
        variance[b] = by_mission[b]
    first = Phase(recipient=first_recipient, heard=first_heard)
    second = Phase(recipient=second_recipient, heard=second_heard)
    if is_broadcast:
        count_broadcasts(first, second, counts)
    else:
        count_addressed(first, second, counts)


@compiled()
def _mean_depth(
    timestamp: Float[np.ndarray, "B N N"],
    parent: Int[np.ndarray, "B N N"],
    is_active: Bool[np.ndarray, "B N"] | None,
    hops: Float[np.ndarray, "B"],
) -> bool:
    """Fill `hops`; return whether all parents form trees."""
    num_missions, num_robots = parent.shape[:2]
    depth = np.empty(num_robots, dtype=np.int64)
    path = np.empty(num_robots, dtype=np.int64)
    for b in range(num_missions):
        total = 0
        num_known = 0
        for i in range(num_robots):
            if is_active is not None and not is_active[b, i]:
                continue
            if not _write_depths(timestamp[b, i], parent[b, i], i, path, depth):
                return False
            for j in range(num_robots):
                counts = is_active is None or is_active[b, j]
                if counts and timestamp[b, i, j] > NEVER and j != i:
                    total += depth[j]
                    num_known += 1
        hops[b] = total / num_known if num_known else 0.0
    return True


@compiled(makes_arrays=False)
def _write_depths(
    timestamp: Float[np.ndarray, "N"],
    parent: Int[np.ndarray, "N"],
    i: int,
    path: Int[np.ndarray, "N"],
    depth: Int[np.ndarray, "N"],
) -> bool:
    """Write how deep in robot i's tree those are that it has heard of; return if it is a tree."""
    depth[:] = -1
    depth[i] = 0
    for j in range(len(depth)):
        if timestamp[j] > NEVER:
            # Up to a robot whose depth is known, then back down, so that each is met once.
            k = j
            length = 0
            while depth[k] < 0:
                path[length] = k
                length += 1
                k = parent[k]
                if k < 0 or length == len(depth):
                    return False
            for step in range(length - 1, -1, -1):
                depth[path[step]] = depth[k] + length - step
    return True
