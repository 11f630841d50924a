"""A batch of missions: one policy in one regime, flown side by side, and what each cost."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, fields
from typing import Generic, TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.evaluation.ages import connectivity_floor, count_ages
from swarm_mj.mission import Mission
from swarm_mj.mission.geometry import count_strayed
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.policy import Parameters
from swarm_mj.policies.policy_arguments import USUAL, PolicyArguments
from swarm_mj.policies.registry import make_policy_with
from swarm_mj.protocol.agreement import agreed_window, decay
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.costs import WindowCosts
from swarm_mj.protocol.mission_costs import MISSION_COSTS, MissionCost
from swarm_mj.protocol.packet_counts import Packets
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.simulation.components import Components
from swarm_mj.simulation.rollout import WindowRecord, rollout
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.user_code import one_line_each


@dataclass(frozen=True, kw_only=True)
class Batch:
    """The work of one process at a time."""

    policy: str
    arguments: PolicyArguments = USUAL
    components: Components = Components()  # by name, as they are made in other processes
    parameters: Parameters | None = None  # what it must have, where that is known
    mission: Mission
    seeds: Sequence[int] = ()  # one per mission


@dataclass(frozen=True, kw_only=True)
class Moment:
    """The costs of a window and the state at its end, from which every column takes its term."""

    window: WindowRecord
    packets: Packets  # the window's, taken once for all columns that count them
    timestamp: Float[np.ndarray, "B N N"]  # T^{i,j} [windows]
    now: Float[np.ndarray, "B"]  # t [windows]
    is_active: Bool[np.ndarray, "B N"]  # as in `states`, but never None
    states: RobotStates
    range_m: float  # of a packet in silence
    is_steady: bool  # whether the window is of the second half
    is_last: bool  # whether it is the mission's last
    floor: Float[np.ndarray, "B"]  # the connectivity floor [windows]; nan: custom channel

    @property
    def costs(self) -> WindowCosts:
        """The window's costs."""
        return self.window.costs

    @property
    def task_cost(self) -> Float[np.ndarray, "B"]:
        """The cost of the controller's task; nan if it has none."""
        task_cost = self.costs.task_cost
        return np.full(len(self.now), np.nan) if task_cost is None else task_cost.value

    @property
    def completed_at(self) -> Float[np.ndarray, "B"]:
        """The end of this window where by then everyone has heard of everyone, or nan [windows]."""
        return np.where(self.costs.is_complete, self.now, np.nan)

    @property
    def strayed(self) -> Float[np.ndarray, "B"]:
        """How many robots are out of everyone's range at the mission's end; nan before."""
        if not self.is_last:  # distances of all pairs take as long as a window
            return np.full(len(self.now), np.nan)
        return count_strayed(self.states.position_m, self.range_m, self.is_active)


COLUMN = "column"  # its place among the metadata of a field
Value = TypeVar("Value")  # one number a mission
Add = Callable[[np.ndarray, np.ndarray], np.ndarray]  # the next term to the sum so far


@dataclass(frozen=True, kw_only=True)
class Column(Generic[Value]):
    """How one cost of missions is made of their windows."""

    term: Callable[[Moment], Value]  # of a window
    start: float = 0.0  # before the first window
    add: Add = np.add
    divisor: Callable[[int], int] = lambda _num_windows: 1  # of the sum, by the mission's length


@dataclass(frozen=True, kw_only=True)
class VarianceColumn(Generic[Value]):
    """How one number of missions is made of the whole course of their velocity variance."""

    of_course: Callable[[Float[np.ndarray, "T B"]], Value]  # [m²/s²], a row for each window


def _latest(_before: np.ndarray, term: np.ndarray) -> np.ndarray:
    return term


def _num_steady(num_windows: int) -> int:
    """Return how many windows the second half has."""
    return num_windows - num_windows // 2


def _total(term: Callable[[Moment], Value]) -> Value:
    return field(metadata={COLUMN: Column(term=term)})


def _mean(term: Callable[[Moment], Value]) -> Value:
    return field(metadata={COLUMN: Column(term=term, divisor=lambda num_windows: num_windows)})


def _steady_mean(term: Callable[[Moment], Value]) -> Value:
    return field(metadata={COLUMN: Column(term=term, divisor=_num_steady)})


def _last(term: Callable[[Moment], Value]) -> Value:
    return field(metadata={COLUMN: Column(term=term, start=np.nan, add=_latest)})


def _first(term: Callable[[Moment], Value]) -> Value:
    """Return a column of the least of its terms, of which nan does not count."""
    return field(metadata={COLUMN: Column(term=term, start=np.nan, add=np.fmin)})


def _of_variance(of_course: Callable[[Float[np.ndarray, "T B"]], Value]) -> Value:
    return field(metadata={COLUMN: VarianceColumn(of_course=of_course)})


@dataclass(frozen=True, kw_only=True, eq=False)
class BatchCosts:
    """The costs of missions, in the order of their seeds; nan is what does not exist.

    Each field is declared with the way it is made of windows; all but `ages` are one per mission.
    """

    # Age of information, mean over windows [windows].
    aoi: Float[np.ndarray, "B"] = _mean(lambda at: at.costs.age_windows)
    # As above, over the second half.
    aoi_steady: Float[np.ndarray, "B"] = _steady_mean(
        lambda at: at.costs.age_windows * at.is_steady
    )
    # The connectivity floor, over all windows; nan: custom channel.
    aoi_floor: Float[np.ndarray, "B"] = _mean(lambda at: at.floor)
    # Mean over windows [m²/s²].
    velocity_variance: Float[np.ndarray, "B"] = _mean(lambda at: at.costs.velocity_variance_m2ps2)
    # Depth of the parent trees, mean over windows.
    hops: Float[np.ndarray, "B"] = _mean(lambda at: at.window.hops)
    # Mean over windows; nan if the controller has none.
    task_cost: Float[np.ndarray, "B"] = _mean(lambda at: at.task_cost)
    # As above, after the last window.
    task_cost_last: Float[np.ndarray, "B"] = _last(lambda at: at.task_cost)
    # Everyone had first heard of everyone [windows]; nan: never.
    complete_window: Float[np.ndarray, "B"] = _first(lambda at: at.completed_at)
    # The flock agreed from then on, to the end [windows]; nan: it did not.
    agreed_window: Float[np.ndarray, "B"] = _of_variance(agreed_window)
    # How fast the velocity variance falls at first [1/window]; nan: it does not fall so far.
    decay_rate: Float[np.ndarray, "B"] = _of_variance(lambda variance: decay(variance).rate)
    # Robots out of everyone's range at the end.
    strayed: Float[np.ndarray, "B"] = _last(lambda at: at.strayed)
    # Robots with bodies that crashed; nan: they are points.
    crashed: Float[np.ndarray, "B"] = _last(lambda at: at.states.num_crashed)
    # Energy of a robot with a body in the whole mission [J]; nan: not known, or they are points.
    energy_j: Float[np.ndarray, "B"] = _last(lambda at: at.states.mean_energy_j)
    # As above, of the robot that used most.
    most_energy_j: Float[np.ndarray, "B"] = _last(lambda at: at.states.most_energy_j)
    # Requests or broadcasts.
    packets_sent: Float[np.ndarray, "B"] = _total(lambda at: at.packets.sent)
    # All that were on the air, responses too.
    packets_transmitted: Float[np.ndarray, "B"] = _total(lambda at: at.packets.transmitted)
    # Requests that their addressee decoded.
    packets_delivered: Float[np.ndarray, "B"] = _total(lambda at: at.packets.delivered)
    # Broadcasts that at least one robot decoded.
    packets_heard: Float[np.ndarray, "B"] = _total(lambda at: at.packets.heard)
    # Times that a robot decoded a broadcast.
    packets_receptions: Float[np.ndarray, "B"] = _total(lambda at: at.packets.receptions)
    # Over all missions: how often a robot's knowledge of another had each age, in slots, from 0 to
    # the mission's length.
    ages: Int[np.ndarray, "bins"]

    def of(self, cost: MissionCost) -> Float[np.ndarray, "B"]:
        """Return one of `MISSION_COSTS`, of each mission; raise ValueError for any other cost."""
        if cost not in MISSION_COSTS:
            raise ValueError(f"missions have no cost {cost.column}")
        return getattr(self, cost.column)


COLUMNS: dict[str, Column[np.ndarray] | VarianceColumn[np.ndarray]] = {
    spec.name: spec.metadata[COLUMN] for spec in fields(BatchCosts) if COLUMN in spec.metadata
}
"""The costs of each mission by their names: all but `ages`, which counts over all missions."""


@one_line_each()  # what is raised loses its places on the way between processes
def fly_batch(batch: Batch) -> BatchCosts:
    """Fly a batch's missions from the first window to the last.

    A mission's costs depend on its own seed, not on the missions beside it. Raises ValueError for
    an unknown policy, one that has changed, or a bad seed; and if no connected team could be drawn,
    or a part of the user's own raised.
    """
    swarm, flown = start_batch(batch)
    return costs_of(swarm, flown)


def start_batch(batch: Batch) -> tuple[Swarm, Iterator[WindowRecord]]:
    """Return a batch's missions, and their flight window by window; raises as `fly_batch` does."""
    swarm = Swarm(batch.mission, batch.seeds, **batch.components.given)
    policy = make_policy_with(batch.arguments, batch.policy, batch.mission)
    if batch.parameters is not None and policy.parameters != batch.parameters:
        raise ValueError(
            f"policy {batch.policy} has changed since the evaluation began; evaluate a copy of it"
        )
    return swarm, rollout(swarm, policy)


def costs_of(swarm: Swarm, flown: Iterable[WindowRecord]) -> BatchCosts:
    """Add up what missions cost, window by window: however many fly, the sums round alike."""
    num_windows = swarm.mission.num_windows
    num_missions = len(swarm.now)
    folded = {name: column for name, column in COLUMNS.items() if isinstance(column, Column)}
    sums = {name: np.full(num_missions, column.start) for name, column in folded.items()}
    ages = np.zeros(round(num_windows / SLOT_WINDOWS) + 1, dtype=np.int64)
    variance: list[np.ndarray] = []
    for at in _moments(swarm, flown):
        for name, column in folded.items():
            sums[name] = column.add(sums[name], column.term(at))
        count_ages(at.timestamp, at.now, ages, at.is_active)
        variance.append(at.costs.velocity_variance_m2ps2)
    course = np.stack(variance)
    costs: dict[str, np.ndarray] = {}
    for name, column in COLUMNS.items():
        if isinstance(column, Column):
            costs[name] = _finite(sums[name] / column.divisor(num_windows))
        else:
            costs[name] = column.of_course(course)
    return BatchCosts(**costs, ages=ages)


def _moments(swarm: Swarm, flown: Iterable[WindowRecord]) -> Iterator[Moment]:
    """Yield the end of each window."""
    mission = swarm.mission
    num_missions, num_robots = swarm.states.position_m.shape[:2]
    num_early = mission.num_windows - _num_steady(mission.num_windows)
    # The floor is by the mission's own range, which other channels need not have.
    has_floor = isinstance(swarm.channel, FreeSpaceRadio) and swarm.channel == radio_of(mission)
    shared = np.full_like(swarm.buffers.timestamp, NEVER)
    floor = np.full(num_missions, np.nan)
    for window in flown:
        states = swarm.states
        now = swarm.now
        # Always an array, so that the loops below are compiled for one kind of arguments.
        is_active = states.is_active
        if is_active is None:
            is_active = np.ones((num_missions, num_robots), np.bool_)
        if has_floor:
            floor = connectivity_floor(shared, states.position_m, mission.range_m, now, is_active)
        yield Moment(
            window=window,
            packets=window.costs.packets,
            timestamp=swarm.buffers.timestamp,
            now=now,
            is_active=is_active,
            states=states,
            range_m=mission.range_m,
            is_steady=bool(now[0] > num_early),
            is_last=bool(now[0] >= mission.num_windows),
            floor=floor,
        )


def merge(batches: Sequence[BatchCosts]) -> BatchCosts:
    """Return batches of the same policy and regime as one, in the order given; `ages` add up."""
    costs: dict[str, np.ndarray] = {}
    for name in COLUMNS:
        costs[name] = np.concatenate([getattr(each, name) for each in batches])
    return BatchCosts(**costs, ages=np.sum([each.ages for each in batches], axis=0))


def _finite(values: Float[np.ndarray, "B"]) -> Float[np.ndarray, "B"]:
    """Return nan in place of infinity: a controller's cost may be, which has no mean."""
    return np.where(np.isfinite(values), values, np.nan)
