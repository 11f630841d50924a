"""A flight: a policy on a swarm from the first window to the last, and what it cost."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from jaxtyping import Float, Shaped

from swarm_mj.policies.policy import Policy
from swarm_mj.protocol.agreement import agreed_window, decay
from swarm_mj.protocol.costs import TaskCost, WindowCosts, mean_hops
from swarm_mj.protocol.packet_counts import COUNTS, PACKET_COUNTS, Packets
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.arguments import check_kind


@dataclass(frozen=True, kw_only=True)
class WindowRecord:
    """One window of a flight, in every mission."""

    costs: WindowCosts
    hops: Float[np.ndarray, "B"]  # mean depth of the parent trees [hops]


PerMission = Float[np.ndarray, "B"]

Mean = TypeVar("Mean")
Count = TypeVar("Count")
SomeMean = TypeVar("SomeMean")  # or what stands where it is not defined
SomeCount = TypeVar("SomeCount")  # likewise


@dataclass(frozen=True, kw_only=True, eq=False)
class FlownCosts(Generic[Mean, Count, SomeMean, SomeCount]):
    """Costs of the windows flown, of one mission or of several side by side.

    Packets are totals. Those of policies that address are delivered or lost, broadcasts are heard
    or not; counts of the other kind are not defined.
    """

    num_windows: int  # that were flown
    aoi_mean: Mean  # age of information, mean over windows [windows]
    velocity_variance_mean: Mean  # mean over windows [m²/s²]
    velocity_variance_first: Mean  # after the first window [m²/s²]
    velocity_variance_last: Mean  # after the last window [m²/s²]
    task_cost_name: str | None = None  # as the controller calls it; None if it has none
    task_cost_unit: str | None = None  # of the next three
    task_cost_mean: Mean | None = None  # mean over windows
    task_cost_first: Mean | None = None  # after the first window
    task_cost_last: Mean | None = None  # after the last window
    hops_mean: Mean  # depth of the parent trees, mean over windows [hops]
    complete_window: SomeCount  # after which everyone had heard of everyone, if ever
    # The first from which on under 1 % of the first velocity variance is left, to the end, if any.
    agreed_window: SomeCount
    # How fast the velocity variance falls over its first three e-foldings, if it does [1/window].
    decay_rate: SomeMean
    decay_rate_error: SomeMean  # the rate's standard error
    packets_sent: Count  # requests or broadcasts
    packets_transmitted: Count  # all that were on the air, responses too
    packets_attempted: SomeCount  # requests
    packets_delivered: SomeCount  # of these, decoded by the recipient
    packets_lost: SomeCount  # and of these, not
    packets_overheard: SomeCount  # receptions of what was meant for another
    packets_answered: SomeCount  # responses that the first sender decoded
    packets_heard: SomeCount  # broadcasts that at least one robot decoded
    hearers_per_packet: SomeMean  # robots that decoded a broadcast, mean [robots]


@dataclass(frozen=True, kw_only=True, eq=False)
class Summary(FlownCosts[PerMission, PerMission, PerMission, PerMission]):
    """Costs of B missions over the windows flown: a number each, nan where it is not defined."""


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
        TypeError: If they are no windows.
    """
    check_kind("flown", flown, Iterable, "rollout(swarm, policy)")
    flown = list(flown)
    for window in flown:
        check_kind("each window", window, WindowRecord, "those of rollout(swarm, policy)")
    if not flown:
        raise ValueError("a summary needs at least 1 window flown, not 0")
    variance = [window.costs.velocity_variance_m2ps2 for window in flown]
    fall = decay(np.array(variance))
    is_complete = np.array([window.costs.is_complete for window in flown])
    first_complete = np.argmax(is_complete, axis=0) + 1.0
    packets = _total_packets([window.costs.counts for window in flown])
    num_sent = np.where(packets.sent > 0, packets.sent, np.nan)
    task = _task_cost([window.costs.task_cost for window in flown])
    return Summary(
        num_windows=len(flown),
        aoi_mean=_mean([window.costs.age_windows for window in flown]),
        velocity_variance_mean=_mean(variance),
        velocity_variance_first=variance[0],
        velocity_variance_last=variance[-1],
        task_cost_name=task.name if task else None,
        task_cost_unit=task.unit if task else None,
        task_cost_mean=task.mean if task else None,
        task_cost_first=task.first if task else None,
        task_cost_last=task.last if task else None,
        hops_mean=_mean([window.hops for window in flown]),
        complete_window=np.where(np.any(is_complete, axis=0), first_complete, np.nan),
        agreed_window=agreed_window(np.array(variance)),
        decay_rate=fall.rate,
        decay_rate_error=fall.error,
        packets_sent=packets.sent,
        packets_transmitted=packets.transmitted,
        packets_attempted=packets.attempted,
        packets_delivered=packets.delivered,
        packets_lost=packets.lost,
        packets_overheard=packets.overheard,
        packets_answered=packets.answered,
        packets_heard=packets.heard,
        hearers_per_packet=packets.receptions / num_sent,
    )


def _total_packets(windows: Sequence[Shaped[np.ndarray, "B"]]) -> Packets:
    """Return each mission's packets in all windows, whose `COUNTS` are given [packets]."""
    # As plain numbers: NumPy takes ten times as long to join arrays with fields.
    numbers = np.array([counts.view(np.float64) for counts in windows])
    totals = np.sum(numbers, axis=0).view(COUNTS)
    return Packets._make(totals[name] for name in PACKET_COUNTS)


class _TaskCosts(NamedTuple):
    """The cost of the robots' task over a flight, as `Summary` has it."""

    name: str
    unit: str
    mean: Float[np.ndarray, "B"]
    first: Float[np.ndarray, "B"]
    last: Float[np.ndarray, "B"]


def _task_cost(windows: Sequence[TaskCost | None]) -> _TaskCosts | None:
    """Return the task's cost over windows; None if the controller has none."""
    costs = [cost for cost in windows if cost is not None]
    if not costs:
        return None
    return _TaskCosts(
        name=costs[0].name,
        unit=costs[0].unit,
        mean=_mean([cost.value for cost in costs]),
        first=costs[0].value,
        last=costs[-1].value,
    )


def _mean(windows: Sequence[Float[np.ndarray, "B"]]) -> Float[np.ndarray, "B"]:
    """Return each mission's mean over windows."""
    # Contiguous rows, as NumPy adds those in an order that does not depend on their number.
    return np.mean(np.ascontiguousarray(np.array(windows).T), axis=1)
