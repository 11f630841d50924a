"""A flight: a policy on a swarm from the first window to the last, and what it cost."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from swarm_mj.policies.policy import Policy
from swarm_mj.protocol.costs import PACKET_COUNTS, TaskCost, WindowCosts, mean_hops
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.fields import check_kind


@dataclass(frozen=True, kw_only=True)
class WindowRecord:
    """One window of a flight, in every mission."""

    costs: WindowCosts
    hops: Float[np.ndarray, "B"]  # mean depth of the parent trees [hops]


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Costs of B missions over the windows flown; packets are totals.

    Packets of policies that address are delivered or lost, broadcasts are heard or not; counts of
    the other kind are nan.
    """

    num_windows: int
    aoi_mean: Float[np.ndarray, "B"]  # Eq. 10 [windows]
    velocity_variance_mean: Float[np.ndarray, "B"]  # Eq. 17 [m²/s²]
    velocity_variance_first: Float[np.ndarray, "B"]  # after the first window [m²/s²]
    velocity_variance_last: Float[np.ndarray, "B"]  # after the last window [m²/s²]
    task_cost_name: str | None = None  # as the controller calls it; None if it has none
    task_cost_unit: str | None = None
    task_cost_mean: Float[np.ndarray, "B"] | None = None
    task_cost_first: Float[np.ndarray, "B"] | None = None  # after the first window
    task_cost_last: Float[np.ndarray, "B"] | None = None  # after the last window
    hops_mean: Float[np.ndarray, "B"]  # depth of the parent trees [hops]
    complete_window: Float[np.ndarray, "B"]  # everyone had first heard of everyone, or nan
    packets_sent: Float[np.ndarray, "B"]  # requests or broadcasts
    packets_transmitted: Float[np.ndarray, "B"]  # all that were on the air, responses too
    packets_attempted: Float[np.ndarray, "B"]  # requests
    packets_delivered: Float[np.ndarray, "B"]
    packets_lost: Float[np.ndarray, "B"]
    packets_overheard: Float[np.ndarray, "B"]
    packets_answered: Float[np.ndarray, "B"]
    packets_heard: Float[np.ndarray, "B"]  # broadcasts that at least one robot decoded
    hearers_per_packet: Float[np.ndarray, "B"]  # robots that decoded a broadcast; nan if none flew


def rollout(swarm: Swarm, policy: Policy | None = None) -> Iterator[WindowRecord]:
    """Fly the missions, one window at a time, for the caller to watch, record or break off.

    Args:
        swarm: The B missions, at their start.
        policy: It is started first; None is the one that was started already.

    Yields:
        What each window cost, each number [B], when the swarm stands at the end of that window.

    Raises:
        ValueError: If the swarm has flown already; and as `Swarm.step` does. As of any generator,
            this is raised when the first window is asked for.
        TypeError: If it is no swarm; and as `Swarm.step` does.

    Example:
        >>> mission = paper("flocking")
        >>> summary = summarise(rollout(Swarm(mission, [1]), make_policy("tdma", mission)))
        >>> summary.aoi_mean.shape
        (1,)
    """
    check_kind("swarm", swarm, Swarm, "Swarm(mission, [1])")
    if np.any(swarm.now > 0):
        raise ValueError(f"the swarm has flown {swarm.now[0]:g} windows already; restart it first")
    if policy is not None:
        swarm.start(policy)
    for _ in range(swarm.mission.num_windows):
        costs = swarm.step()
        yield WindowRecord(costs=costs, hops=mean_hops(swarm.buffers, swarm.states.is_active))


def summarise(flown: Iterable[WindowRecord]) -> Summary:
    """Return the costs of missions over the windows flown.

    Args:
        flown: The windows in order; what `rollout` yields will do.

    Returns:
        Means over the windows, and totals of packets, of every mission.

    Raises:
        ValueError: If no window was flown.
    """
    flown = list(flown)
    if not flown:
        raise ValueError("a summary needs at least 1 window flown, not 0")
    variance = [window.costs.velocity_variance_m2ps2 for window in flown]
    is_complete = np.stack([window.costs.is_complete for window in flown])
    first_complete = np.argmax(is_complete, axis=0) + 1.0
    counted = np.sum([window.costs.packets for window in flown], axis=0)
    packets = dict(zip(PACKET_COUNTS, counted, strict=True))
    receptions = packets.pop("receptions")
    num_sent = np.where(packets["sent"] > 0, packets["sent"], np.nan)
    return Summary(
        num_windows=len(flown),
        aoi_mean=_mean([window.costs.age_windows for window in flown]),
        velocity_variance_mean=_mean(variance),
        velocity_variance_first=variance[0],
        velocity_variance_last=variance[-1],
        **_task_costs([window.costs.task_cost for window in flown]),
        hops_mean=_mean([window.hops for window in flown]),
        complete_window=np.where(np.any(is_complete, axis=0), first_complete, np.nan),
        **{f"packets_{name}": count for name, count in packets.items()},
        hearers_per_packet=receptions / num_sent,
    )


def _task_costs(windows: Sequence[TaskCost | None]) -> dict[str, Any]:
    """Return the task's costs over windows; nothing if it has none."""
    costs = [cost for cost in windows if cost is not None]
    if not costs:
        return {}
    return {
        "task_cost_name": costs[0].name,
        "task_cost_unit": costs[0].unit,
        "task_cost_mean": _mean([cost.value for cost in costs]),
        "task_cost_first": costs[0].value,
        "task_cost_last": costs[-1].value,
    }


def _mean(windows: Sequence[Float[np.ndarray, "B"]]) -> Float[np.ndarray, "B"]:
    """Return each mission's mean over windows."""
    # Contiguous rows, as NumPy adds those in an order that does not depend on their number.
    return np.mean(np.ascontiguousarray(np.stack(windows, axis=1)), axis=1)
