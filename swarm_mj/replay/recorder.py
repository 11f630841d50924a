"""The record of a flight for its replay: one mission's windows as plain arrays."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from numbers import Integral
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.costs import TaskCost
from swarm_mj.replay import links
from swarm_mj.replay.footage import Facts, Footage, frame, shown_ground
from swarm_mj.replay.log import Log
from swarm_mj.replay.palette import nice_scale
from swarm_mj.replay.replay_size import AGE_BYTES, MAX_AGE_MATRIX_BYTES, in_matrix
from swarm_mj.simulation.components import components_in
from swarm_mj.simulation.rollout import WindowRecord
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.compiled import compiled


def check_observer(observer: int, num_robots: int) -> None:
    """Raise ValueError unless there is this robot, whose knowledge a replay shows."""
    is_whole = isinstance(observer, Integral) and not isinstance(observer, bool)
    if not is_whole or not 0 <= observer < num_robots:
        raise ValueError(f"observer must be from 0 to {num_robots - 1}, not {observer!r}")


class _Row(NamedTuple):
    """A mission's window as it is recorded, or, of all windows, arrays with their axis first.

    Each is a field of `Log`, of the same name.
    """

    position_m: Float[np.ndarray, "*T N 2"]
    velocity_mps: Float[np.ndarray, "*T N 2"]
    recipient: Int[np.ndarray, "*T 2 N"]
    heard: Int[np.ndarray, "*T 2 N"]
    is_on: Bool[np.ndarray, "*T N"]
    believed_m: Float[np.ndarray, "*T N 2"]
    ego_age: Float[np.ndarray, "*T N"]
    known_age: Float[np.ndarray, "*T N"]
    parent: Int[np.ndarray, "*T N"]
    age_mean: Float[np.ndarray, "*T"]
    age_std: Float[np.ndarray, "*T"]
    age_max: Float[np.ndarray, "*T"]
    velocity_variance_m2ps2: Float[np.ndarray, "*T"]


def _stacked(rows: Sequence[_Row]) -> _Row:
    """Return the rows of all windows as one, of arrays with the windows' axis first."""
    arrays = {}
    for name in _Row._fields:
        arrays[name] = np.stack([getattr(row, name) for row in rows])
    return _Row(**arrays)


class _Compared(NamedTuple):
    """The fields of `Log` that are from snapshots of the radio, of which free space has none."""

    is_cut_off: Bool[np.ndarray, "T N"]
    mismatch: links.LinkMismatch
    num_believed: Int[np.ndarray, "C"]
    num_working: Int[np.ndarray, "C"]


class Recorder:
    """Copies what a replay shows from one of a swarm's missions, window by window."""

    def __init__(self, swarm: Swarm, *, ego: int = 0, index: int = 0) -> None:
        """Prepare the record of what the ego robot knows; raise ValueError if there is none."""
        num_robots = swarm.mission.num_robots
        check_observer(ego, num_robots)
        self._in_matrix = np.array(in_matrix(num_robots))
        matrices_bytes = AGE_BYTES * len(self._in_matrix) ** 2 * swarm.mission.num_windows
        self._stride = max(1, int(np.ceil(matrices_bytes / MAX_AGE_MATRIX_BYTES)))
        self._radio_stride = links.stride_of(swarm, self._stride)
        self._swarm = swarm
        self._ego = ego
        self._index = index
        self._rows: list[_Row] = []
        self._age: list[np.ndarray] = []
        self._task_costs: list[TaskCost] = []
        self._snapshots: list[links.RadioSnapshot] = []  # none in free space

    def add(self, flown: WindowRecord | None = None) -> None:
        """Record the window that was just flown, if any, with its costs, if they are known."""
        if len(self._rows) % self._stride == 0:
            self._add_age_matrix()
        if len(self._rows) % self._radio_stride == 0:
            snapshot = links.radio_snapshot(self._swarm, self._index)
            if snapshot is not None:
                self._snapshots.append(snapshot)
        age_mean = np.nan
        velocity_variance = np.nan
        if flown is not None:
            age_mean = flown.costs.age_windows[self._index]
            velocity_variance = flown.costs.velocity_variance_m2ps2[self._index]
            if flown.costs.task_cost is not None:
                self._task_costs.append(flown.costs.task_cost)
        row = self._row(age_mean, velocity_variance)
        # It comes last: whatever an interrupt leaves unfinished, rows count the whole windows.
        self._rows.append(row)

    def _add_age_matrix(self) -> None:
        timestamp = self._swarm.buffers.timestamp[self._index]
        some = timestamp[np.ix_(self._in_matrix, self._in_matrix)]
        age = self._swarm.now[self._index] - some
        self._age.append(age.astype(np.float32))  # half the memory; the picture has 256 shades

    def _row(self, age_mean: float, velocity_variance_m2ps2: float) -> _Row:
        """Return the window as the swarm has it now, with costs that only its record knows."""
        swarm = self._swarm
        index = self._index
        own = self._ego
        buffers = swarm.buffers
        states = swarm.states
        timestamp = buffers.timestamp[index]
        robots = np.arange(len(timestamp))
        recipient = [robots, robots]  # silence, of a mission that has not begun
        heard = [robots, robots]
        if swarm.phases:
            recipient = [phase.recipient[index] for phase in swarm.phases]
            heard = [phase.heard[index] for phase in swarm.phases]
        is_on = np.ones(len(robots), dtype=np.bool_)  # without failures nobody is off
        if states.is_active is not None:
            is_on = states.is_active[index]
        age_std, age_max = _age_spread(timestamp, swarm.now[index], is_on)
        ego_age = swarm.now[index] - timestamp[own]
        is_known = (timestamp[own] > NEVER) | buffers.is_granted[index]
        # Copies: the swarm writes its arrays in place, and a view would keep a whole matrix.
        return _Row(
            position_m=np.array(states.position_m[index]),
            velocity_mps=np.array(states.velocity_mps[index]),
            recipient=np.array(recipient),
            heard=np.array(heard),
            is_on=np.array(is_on),
            believed_m=np.array(buffers.position_m[index, own]),
            ego_age=ego_age,
            known_age=np.where(is_known, ego_age, np.nan),
            parent=np.array(buffers.parent[index, own]),
            age_mean=np.array(age_mean),
            age_std=np.array(age_std),
            age_max=np.array(age_max),
            velocity_variance_m2ps2=np.array(velocity_variance_m2ps2),
        )

    @property
    def num_bytes(self) -> int:
        """The memory taken so far; every window takes the same."""
        row_bytes = sum(array.nbytes for array in self._rows[0]) if self._rows else 0
        ages_bytes = sum(age.nbytes for age in self._age)
        compared_bytes = sum(each.group.nbytes + each.links.nbytes for each in self._snapshots)
        return len(self._rows) * row_bytes + ages_bytes + compared_bytes

    def log(self, config: Mapping[str, Any] | None = None) -> Log:
        """Return all that was recorded, `config` for titles; raise ValueError if it is nothing."""
        if not self._rows:
            raise ValueError("a replay needs at least 1 window flown, not 0")
        flown = _stacked(self._rows)
        compared = self._compared(flown.is_on)
        window = np.arange(1, len(self._rows) + 1)
        age_window = window[:: self._stride]
        # An interrupt within `add` leaves one matrix, snapshot or cost too many.
        age = np.stack(self._age[: len(age_window)])
        costs = self._task_costs[: len(window)]
        value = np.array([cost.value[self._index] for cost in costs])
        facts = self._facts(config or {}, age)
        packets = links.fates(
            flown.recipient, flown.heard, flown.position_m, is_broadcast=facts.is_broadcast
        )
        return Log(
            facts=facts,
            window=window,
            packets=packets,
            ground=shown_ground(flown.position_m, facts.mission),
            scene=self._swarm.scene,
            age_window=age_window,
            age=age,
            task_cost=replace(costs[0], value=value) if costs else None,
            **flown._asdict(),
            **compared._asdict(),
        )

    def _facts(self, config: Mapping[str, Any], age: Float[np.ndarray, "K M M"]) -> Facts:
        return Facts(
            mission=self._swarm.mission,
            policy=config.get("policy", ""),  # nothing names that of a picture, or of a training
            seed=config.get("seed", 0),
            observer=self._ego,
            is_broadcast=self._swarm.is_broadcast,
            full_scale=nice_scale(age),
            **components_in(config).names,
        )

    def _compared(self, is_on: Bool[np.ndarray, "T N"]) -> _Compared:
        window = np.arange(1, len(is_on) + 1)[:: self._radio_stride]
        snapshots = self._snapshots[: len(window)]
        is_cut_off = np.zeros_like(is_on)
        mismatch = links.NO_MISMATCH
        if snapshots:
            rows = np.concatenate([snapshot.links for snapshot in snapshots])
            num_links = [len(snapshot.links) for snapshot in snapshots]
            rows["row"] = np.repeat(np.arange(len(snapshots)), num_links)
            mismatch = links.LinkMismatch(window=window, links=rows)
            group = np.stack([snapshot.group for snapshot in snapshots])
            # Each snapshot stands until the next.
            group = group[np.arange(len(is_on)) // self._radio_stride]
            is_apart = group != group[:, [self._ego]]
            is_cut_off = is_apart & is_on & is_on[:, [self._ego]]
        return _Compared(
            is_cut_off=is_cut_off,
            mismatch=mismatch,
            num_believed=np.array([snapshot.num_believed for snapshot in snapshots], int),
            num_working=np.array([snapshot.num_working for snapshot in snapshots], int),
        )


def moment(swarm: Swarm, index: int = 0, *, observer: int = 0) -> Footage:
    """Return one of a swarm's missions as it is now, with the packets of the window just flown.

    Args:
        swarm: Of any number of missions.
        index: The mission; those below 0 count from the end.
        observer: The robot by whose knowledge robots are coloured.

    Returns:
        One window of footage, which `SceneRenderer` draws.

    Raises:
        IndexError: There is no such mission.
        ValueError: There is no such robot.
    """
    recorder = Recorder(swarm, ego=observer, index=index)
    recorder.add()
    seen = recorder.log()
    # Darkest from a round on, in which everyone has its turn.
    facts = replace(seen.facts, full_scale=float(swarm.mission.num_robots))
    # As wide wherever the team is: a live picture does not know where it will fly.
    half_side_m = swarm.mission.half_side_m
    ground = frame(seen.position_m, half_side_m)
    ground = replace(ground, reach_m=max(half_side_m, ground.reach_m))
    return replace(seen, facts=facts, ground=ground)


@compiled()
def _age_spread(
    timestamp: Float[np.ndarray, "N N"], now: float, is_on: Bool[np.ndarray, "N"]
) -> tuple[float, float]:
    """Return the standard deviation and the worst of ages between robots that are on [windows]."""
    # In loops: of thousands of robots, an array of all pairs takes a gigabyte.
    num_pairs = 0
    total = 0.0
    oldest = -np.inf
    for i in np.flatnonzero(is_on):
        for j in range(len(is_on)):
            if is_on[j] and j != i:
                num_pairs += 1
                total += now - timestamp[i, j]
                oldest = max(oldest, now - timestamp[i, j])
    mean = total / num_pairs
    squares = 0.0
    for i in np.flatnonzero(is_on):
        for j in range(len(is_on)):
            if is_on[j] and j != i:
                squares += (now - timestamp[i, j] - mean) ** 2
    return math.sqrt(squares / num_pairs), oldest
