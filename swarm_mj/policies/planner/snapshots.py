"""Snapshots of the team: what the planner's robots agree on, and the fields that carry it.

Index order: row `i` of every array is robot i's snapshot, column `k` what it says about robot k.
Packets hold N² ages, those that the last plan leads to, so they grow with the square of the team:
7.3 kB for 40 robots, 27 kB for 80, and 164 kB for 200.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission import Mission
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.policy import TeamView
from swarm_mj.protocol.packets import POSITION_BITS, PacketField, age, identity, position, times

NUM_SENT = 2  # snapshots or tables in a packet: the current one, and the best of the next


@dataclass(frozen=True, kw_only=True)
class Proposals:
    """All robots' proposals of one moment, and whose each of them holds by now.

    What a robot made never changes. Packets carry it whole, so its maker's identity stands for it.
    """

    rank: Int[np.ndarray, "N"]  # of what i made; the best has rank 0
    held: Int[np.ndarray, "N"]  # whose i holds: the best that it made or decoded

    def adopt(self, heard: Int[np.ndarray, "N"]) -> None:
        """Let robots take over what the senders they decoded hold, where that is better."""
        theirs = self.held[heard]
        self.held[:] = np.where(self.rank[theirs] < self.rank[self.held], theirs, self.held)


@dataclass(frozen=True, kw_only=True)
class Snapshots(Proposals):
    """Each robot i's belief about every robot k when the epoch began: one snapshot a robot."""

    is_known: Bool[np.ndarray, "N N"]  # whether i had ever heard of k
    is_fresh: Bool[np.ndarray, "N N"]  # whether that was not too long ago
    position_m: Float[np.ndarray, "N N D"]  # of k in the middle of the epoch [m]
    position_std_m: Float[np.ndarray, "N N"]  # its standard deviation, per axis [m]
    timestamp: Float[np.ndarray, "N N"]  # when k observed itself so [windows]


def take_snapshots(
    view: TeamView, settings: PlannerSettings, *, window_s: float, windows_ahead: float
) -> Snapshots:
    """Return every robot's snapshot, row i from its own buffer alone.

    They are taken for the middle of an epoch some windows ahead. The best has most robots fresh,
    then the least mean age of these, then the lowest identity.
    """
    is_known = view.is_known
    velocity_mps = view.velocity_mps
    num_robots = len(is_known)
    num_known = np.sum(is_known, axis=1)
    # How far beliefs err grows with their age, and with how differently robots move.
    age = np.where(is_known, view.now - view.timestamp, 0.0)
    ahead = age + windows_ahead
    mean_mps = np.sum(velocity_mps * is_known[..., None], axis=1) / num_known[:, None]
    apart_mps = (velocity_mps - mean_mps[:, None]) * is_known[..., None]
    variance = np.sum(apart_mps**2, axis=(1, 2)) / num_known
    position_std_m = settings.std_per_distance * np.sqrt(variance)[:, None] * window_s * ahead
    fresh_windows = max(settings.fresh_rounds * num_robots, settings.min_fresh_windows)
    is_fresh = is_known & (age <= fresh_windows)
    num_fresh = np.maximum(np.sum(is_fresh, axis=1), 1)  # a robot that is off grows old to itself
    # A team at rest of which many are stale has lost nobody: its robots fly plans that differ.
    rests = np.all(is_known, axis=1) & ~np.any(position_std_m, axis=1)
    is_divided = rests & (num_fresh < settings.min_fresh_share * num_robots)
    # Robots are not expected to keep their velocities for longer than that.
    steady = np.minimum(ahead, settings.steady_windows)
    # `lexsort` sorts by its last key first.
    mean_age = np.sum(age * is_fresh, axis=1) / num_fresh
    best_first = np.lexsort((mean_age, -num_fresh))
    return Snapshots(
        is_known=is_known,
        is_fresh=is_fresh | is_divided[:, None],
        position_m=view.position_m + velocity_mps * steady[..., None] * window_s,
        position_std_m=position_std_m,
        timestamp=view.timestamp.copy(),
        rank=np.argsort(best_first),
        held=np.arange(num_robots),
    )


def snapshot_fields(mission: Mission) -> tuple[PacketField, ...]:
    """Return the fields of two snapshots, as precise as T and M."""
    num_robots = mission.num_robots
    ages = {"count": num_robots**2, "step": 1 / 16, "unit": "windows"}
    speeds = {"step": 2.0 * mission.max_velocity_mps / 2**16, "unit": "m/s"}
    snapshot = (
        identity("owner of the snapshot", mission),
        PacketField(name="robots known to the owner", bits=1, count=num_robots),
        # The errors of positions follow from their ages and this number.
        PacketField(name="spread of velocities", bits=16, **speeds),
        # 16 bits reach up to 4,096 windows.
        PacketField(name="expected age, of all pairs", bits=16, **ages),
        times(age("age in the snapshot"), num_robots),
        times(position("position in the snapshot", mission, POSITION_BITS), num_robots),
    )
    return tuple(times(field, NUM_SENT) for field in snapshot)
