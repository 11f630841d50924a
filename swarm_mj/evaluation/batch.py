"""A batch of missions: one policy in one regime, flown side by side, and what each cost."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from jaxtyping import Bool, Float, Int
from msgspec import Meta

from swarm_mj.evaluation.lower_bound import ConnectivityFloor
from swarm_mj.mission import Mission
from swarm_mj.mission.components import Components, one_line_each
from swarm_mj.policies.policy import Parameters, Policy
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.window import SLOT_WINDOWS
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.simulation.rollout import WindowRecord, rollout
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.compiled import compiled

MEANS = ("aoi", "velocity_variance", "hops")  # over windows
TOTALS = {  # totals, and what `protocol.costs.Packets` calls them
    "packets_sent": "sent",
    "packets_transmitted": "transmitted",
    "packets_delivered": "delivered",
    "packets_heard": "heard",
    "receptions": "receptions",
}
# What is allowed where costs are read back; rounding may leave a little less than nothing.
Cost = Annotated[float, Meta(ge=-1e-6, le=1e30)]
Count = Annotated[int, Meta(ge=0, le=2**53)]


@dataclass(frozen=True, kw_only=True)
class Batch:
    """The work of one process at a time."""

    policy: str  # a name among `POLICIES`, or a directory
    probability: float | None  # of a transmission; None is the policy's own
    is_deterministic: bool = False  # a learned policy takes its most probable recipient
    features: tuple[str, ...] = ()  # users' own, that a learned policy may see by
    components: Components = Components()  # by name, as they are made in other processes
    parameters: Parameters | None = None  # what it must have, where that is known
    mission: Mission
    seeds: tuple[int, ...] = ()  # one per mission

    def made(self) -> Policy:
        """Make the batch's policy."""
        how = {"is_deterministic": self.is_deterministic, "features": self.features}
        return make_policy(self.policy, self.mission, self.probability, **how)


@dataclass(frozen=True, kw_only=True)
class BatchCosts:
    """The costs of a batch: one number per mission, in the order of the seeds."""

    aoi: list[Cost]  # Eq. 10, mean over windows [windows]
    aoi_steady: list[Cost]  # as above, over the second half of the mission
    aoi_floor: list[Cost | None]  # the connectivity floor, as above; None: own channel
    velocity_variance: list[Cost]  # Eq. 17, mean over windows [m²/s²]
    hops: list[Cost]  # depth of the parent trees, mean over windows
    task_cost: list[Cost | None]  # mean over windows; None if the controller has none
    task_cost_last: list[Cost | None]  # as above, after the last window
    complete_window: list[Count | None]  # everyone had first heard of everyone
    packets_sent: list[Count]  # requests or broadcasts
    packets_transmitted: list[Count]  # all that were on the air, responses too
    packets_delivered: list[Count | None]  # requests that their addressee decoded; None: broadcasts
    packets_heard: list[Count | None]  # broadcasts that somebody decoded; None: addressed packets
    receptions: list[Count | None]  # times that a robot decoded a broadcast; None: as above
    ages: list[Count]  # of all missions: how often a robot's knowledge of another had each age,
    # in slots, from 0 to the mission's length


def num_ages(mission: Mission) -> int:
    """Return how many different ages there can be, in slots."""
    return round(mission.num_windows / SLOT_WINDOWS) + 1


@one_line_each()  # what is raised loses its places on the way between processes
def fly_batch(batch: Batch) -> BatchCosts:
    """Fly a batch's missions from the first window to the last.

    A mission's costs depend on its own seed, not on the missions beside it.

    Raises:
        ValueError: Unknown policy, one that has changed, a bad seed, no connected team could be
            drawn, or a part of the user's own raised.
    """
    swarm, policy = Swarm(batch.mission, batch.seeds, **batch.components.given), batch.made()
    if batch.parameters is not None and policy.parameters != batch.parameters:
        raise ValueError(
            f"policy {batch.policy} has changed since the evaluation began; evaluate a copy of it"
        )
    tally = Tally(swarm)
    for flown in rollout(swarm, policy):
        tally.add(flown)
    return tally.costs()


class Tally:
    """Adds up what missions cost while they are flown.

    Sums run window by window, so they round alike whatever the number of missions.
    """

    def __init__(self, swarm: Swarm) -> None:
        """Start at nothing; the swarm is at the start of its missions."""
        mission, num_missions = swarm.mission, len(swarm.now)
        self._swarm = swarm
        self._floor: ConnectivityFloor | None = None  # it uses the mission's own range
        if isinstance(swarm.channel, FreeSpaceRadio) and swarm.channel == radio_of(mission):
            self._floor = ConnectivityFloor(num_missions, mission.num_robots, mission.range_m)
        self._num_steady = mission.num_windows - mission.num_windows // 2
        names = (*MEANS, "aoi_steady", "aoi_floor", *TOTALS)
        self._sums = {name: np.zeros(num_missions) for name in names}
        self._task_cost, self._last_task_cost = np.full((2, num_missions), np.nan)
        self._complete = np.full(num_missions, np.inf)
        self._ages = np.zeros(num_ages(mission), dtype=np.int64)

    def add(self, flown: WindowRecord) -> None:
        """Add a window; the swarm stands at its end."""
        swarm, costs, is_active = self._swarm, flown.costs, self._swarm.states.is_active
        is_steady = swarm.now[0] > swarm.mission.num_windows - self._num_steady
        packets = {name: getattr(costs.packets, count) for name, count in TOTALS.items()}
        added = packets | {
            "aoi": costs.age_windows,
            "aoi_steady": costs.age_windows * is_steady,
            "aoi_floor": self._floor.next(swarm.states.position_m, swarm.now, is_active)
            if self._floor
            else np.nan,
            "velocity_variance": costs.velocity_variance_m2ps2,
            "hops": flown.hops,
        }
        for name, total in self._sums.items():
            total += added[name]
        if costs.task_cost is not None:
            self._last_task_cost = costs.task_cost.value
            self._task_cost = np.nan_to_num(self._task_cost) + costs.task_cost.value
        complete = np.where(costs.is_complete, swarm.now, np.inf)
        np.minimum(self._complete, complete, out=self._complete)
        count_ages(swarm.buffers.timestamp, swarm.now, self._ages, is_active)

    def costs(self) -> BatchCosts:
        """Return what the missions cost, all windows of them flown."""
        sums, num_windows = self._sums, self._swarm.mission.num_windows
        packets: dict[str, Any] = {name: _whole(sums[name]) for name in TOTALS}
        return BatchCosts(
            **{name: (sums[name] / num_windows).tolist() for name in MEANS},
            **packets,
            aoi_steady=(sums["aoi_steady"] / self._num_steady).tolist(),
            aoi_floor=_finite(sums["aoi_floor"] / num_windows),
            task_cost=_finite(self._task_cost / num_windows),
            task_cost_last=_finite(self._last_task_cost),
            complete_window=_whole(self._complete),
            ages=self._ages.tolist(),
        )


def _finite(costs: Float[np.ndarray, "B"]) -> list[float | None]:
    """Costs; what does not apply is None."""
    return [float(cost) if np.isfinite(cost) else None for cost in costs]


def _whole(counts: Float[np.ndarray, "B"]) -> list[int | None]:
    """Whole numbers; what never happened, or does not apply, is None."""
    return [int(count) if np.isfinite(count) else None for count in counts]


@compiled()
def count_ages(
    timestamp: Float[np.ndarray, "B N N"],
    now: Float[np.ndarray, "B"],
    counts: Int[np.ndarray, "bins"],
    is_active: Bool[np.ndarray, "B N"] | None = None,
) -> None:
    """Count how old what each robot knows of each other robot is.

    Args:
        timestamp: T [windows].
        now: t [windows].
        counts: By age in slots; added to in place.
        is_active: Whose pairs count; None is everyone's.
    """
    num_missions, num_robots = timestamp.shape[:2]
    for b in range(num_missions):
        for i in range(num_robots):
            if is_active is not None and not is_active[b, i]:
                continue
            for j in range(num_robots):
                if is_active is None or is_active[b, j]:
                    counts[int((now[b] - timestamp[b, i, j]) / SLOT_WINDOWS)] += 1
            counts[int((now[b] - timestamp[b, i, i]) / SLOT_WINDOWS)] -= 1
