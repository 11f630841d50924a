"""A batch of missions: one policy in one regime, flown side by side, and what each cost."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission import Mission
from swarm_mj.mission.geometry import gather_connected
from swarm_mj.policies.policy import Parameters
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.mission_costs import AOI, TASK_COST, VELOCITY_VARIANCE, MissionCost
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.simulation.components import Components
from swarm_mj.simulation.rollout import WindowRecord, rollout
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.compiled import compiled
from swarm_mj.system.user_code import one_line_each


@dataclass(frozen=True, kw_only=True)
class Batch:
    """The work of one process at a time."""

    policy: str
    how: Mapping[str, Any]  # arguments of `make_policy` beside it and the mission
    components: Components = Components()  # by name, as they are made in other processes
    parameters: Parameters | None = None  # what it must have, where that is known
    mission: Mission
    seeds: Sequence[int] = ()  # one per mission


@dataclass(frozen=True, kw_only=True, eq=False)
class BatchCosts:
    """The costs of missions, in the order of their seeds; nan is what does not exist."""

    aoi: Float[np.ndarray, "B"]  # age of information, mean over windows [windows]
    aoi_steady: Float[np.ndarray, "B"]  # as above, over the second half
    aoi_floor: Float[np.ndarray, "B"]  # the connectivity floor, as above; nan: custom channel
    velocity_variance: Float[np.ndarray, "B"]  # mean over windows [m²/s²]
    hops: Float[np.ndarray, "B"]  # depth of the parent trees, mean over windows
    task_cost: Float[np.ndarray, "B"]  # mean over windows; nan if the controller has none
    task_cost_last: Float[np.ndarray, "B"]  # as above, after the last window
    complete_window: Float[np.ndarray, "B"]  # everyone had first heard of everyone; nan: never
    packets_sent: Float[np.ndarray, "B"]  # requests or broadcasts
    packets_transmitted: Float[np.ndarray, "B"]  # all that were on the air, responses too
    packets_delivered: Float[np.ndarray, "B"]  # requests that their addressee decoded
    packets_heard: Float[np.ndarray, "B"]  # broadcasts that at least one robot decoded
    packets_receptions: Float[np.ndarray, "B"]  # times that a robot decoded a broadcast
    # Over all missions: how often a robot's knowledge of another had each age, in slots, from 0 to
    # the mission's length.
    ages: Int[np.ndarray, "bins"]

    def of(self, cost: MissionCost) -> Float[np.ndarray, "B"]:
        """Return one of `MISSION_COSTS`, of each mission; raise ValueError for any other cost."""
        if cost is AOI:
            return self.aoi
        if cost is VELOCITY_VARIANCE:
            return self.velocity_variance
        if cost is TASK_COST:
            return self.task_cost
        raise ValueError(f"missions have no cost {cost.column}")


@one_line_each()  # what is raised loses its places on the way between processes
def fly_batch(batch: Batch) -> BatchCosts:
    """Fly a batch's missions from the first window to the last.

    A mission's costs depend on its own seed, not on the missions beside it. Raises ValueError for
    an unknown policy, one that has changed, or a bad seed; and if no connected team could be drawn,
    or a part of the user's own raised.
    """
    swarm = Swarm(batch.mission, batch.seeds, **batch.components.given)
    policy = make_policy(batch.policy, batch.mission, **batch.how)
    if batch.parameters is not None and policy.parameters != batch.parameters:
        raise ValueError(
            f"policy {batch.policy} has changed since the evaluation began; evaluate a copy of it"
        )
    return costs_of(swarm, rollout(swarm, policy))


def costs_of(swarm: Swarm, flown: Iterable[WindowRecord]) -> BatchCosts:
    """Add up what missions cost, window by window: however many fly, the sums round alike."""
    mission = swarm.mission
    shape = swarm.states.position_m.shape[:2]
    num_windows = mission.num_windows
    num_steady = num_windows - num_windows // 2
    # The floor is by the mission's own range, which other channels need not have.
    has_floor = isinstance(swarm.channel, FreeSpaceRadio) and swarm.channel == radio_of(mission)
    shared = np.full_like(swarm.buffers.timestamp, NEVER)
    missing = np.full(shape[0], np.nan)
    complete = missing
    task_cost = missing
    # Sums over windows, of each mission.
    aoi = np.zeros(shape[0])
    aoi_steady = np.zeros(shape[0])
    aoi_floor = np.zeros(shape[0])
    velocity_variance = np.zeros(shape[0])
    hops = np.zeros(shape[0])
    task_cost_sum = np.zeros(shape[0])
    sent = np.zeros(shape[0])
    transmitted = np.zeros(shape[0])
    delivered = np.zeros(shape[0])
    heard = np.zeros(shape[0])
    receptions = np.zeros(shape[0])
    ages = np.zeros(round(num_windows / SLOT_WINDOWS) + 1, dtype=np.int64)
    for window in flown:
        costs = window.costs
        states = swarm.states
        now = swarm.now
        # Always an array, so that the loops below are compiled for one kind of arguments.
        is_on = np.ones(shape, np.bool_) if states.is_active is None else states.is_active
        floor = missing
        if has_floor:
            floor = connectivity_floor(shared, states.position_m, mission.range_m, now, is_on)
        task_cost = costs.task_cost.value if costs.task_cost else missing
        aoi += costs.age_windows
        aoi_steady += costs.age_windows * (now[0] > num_windows - num_steady)
        aoi_floor += floor
        velocity_variance += costs.velocity_variance_m2ps2
        hops += window.hops
        task_cost_sum += task_cost
        packets = costs.packets
        sent += packets.sent
        transmitted += packets.transmitted
        delivered += packets.delivered
        heard += packets.heard
        receptions += packets.receptions
        complete = np.fmin(complete, np.where(costs.is_complete, now, np.nan))
        count_ages(swarm.buffers.timestamp, now, ages, is_on)
    return BatchCosts(
        aoi=_finite(aoi / num_windows),
        aoi_steady=_finite(aoi_steady / num_steady),
        aoi_floor=_finite(aoi_floor / num_windows),
        velocity_variance=_finite(velocity_variance / num_windows),
        hops=_finite(hops / num_windows),
        task_cost=_finite(task_cost_sum / num_windows),
        task_cost_last=_finite(task_cost),
        complete_window=_finite(complete),
        packets_sent=_finite(sent),
        packets_transmitted=_finite(transmitted),
        packets_delivered=_finite(delivered),
        packets_heard=_finite(heard),
        packets_receptions=_finite(receptions),
        ages=ages,
    )


def _finite(values: Float[np.ndarray, "B"]) -> Float[np.ndarray, "B"]:
    """Return nan in place of infinity: a controller's cost may be, which has no mean."""
    return np.where(np.isfinite(values), values, np.nan)


@compiled()
def count_ages(
    timestamp: Float[np.ndarray, "B N N"],
    now: Float[np.ndarray, "B"],
    counts: Int[np.ndarray, "bins"],
    is_active: Bool[np.ndarray, "B N"],
) -> None:
    """Add to `counts`, by age in slots, how old what active robots know of each other is."""
    num_missions, num_robots = timestamp.shape[:2]
    for b in range(num_missions):
        for i in range(num_robots):
            if not is_active[b, i]:
                continue
            for j in range(num_robots):
                if is_active[b, j]:
                    counts[int((now[b] - timestamp[b, i, j]) / SLOT_WINDOWS)] += 1
            counts[int((now[b] - timestamp[b, i, i]) / SLOT_WINDOWS)] -= 1


@compiled()
def connectivity_floor(
    timestamp: Float[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N 2"],
    range_m: float,
    now: Float[np.ndarray, "B"],
    is_on: Bool[np.ndarray, "B N"],
) -> Float[np.ndarray, "B"]:
    """Let connected robots share everything at once; return the mean age of all pairs as in II-C.

    Two robots are neighbours while a lone packet decodes between them, within `range_m`. At the end
    of a window, `now`, every robot receives the newest entries of its connected part of the disk
    graph, in T [windows] in place. The age that is left is due to teams that fall apart: the
    floor that no radio goes below, if robots rest while they talk. Only robots that are on share
    and count.
    """
    num_missions, num_robots = position_m.shape[:2]
    age = np.empty(num_missions)
    newest = np.empty(num_robots)
    is_met = np.empty(num_robots, dtype=np.bool_)
    part = np.empty(num_robots, dtype=np.int64)
    for b in range(num_missions):
        is_met[:] = ~is_on[b]  # robots that are off share nothing, so no part begins at them
        total = 0.0
        for first in range(num_robots):
            if is_met[first]:
                continue
            members = part[: gather_connected(position_m[b], range_m, first, is_met, part)]
            newest[:] = timestamp[b, first]
            for i in members:
                np.maximum(newest, timestamp[b, i], newest)  # in place: nothing is allocated
            for i in members:
                newest[i] = now[b]
            for i in members:
                timestamp[b, i] = newest
            total += members.size * newest[is_on[b]].sum()
        num_on = is_on[b].sum()
        age[b] = now[b] - total / (num_on * num_on)
    return age
