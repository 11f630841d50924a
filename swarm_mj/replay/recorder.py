"""The record of a flight for its replay: one mission's windows as plain arrays."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from numbers import Integral
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from swarm_mj.mission.geometry import HEIGHT, PLANE
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.costs import TaskCost
from swarm_mj.replay import links
from swarm_mj.replay.footage import Facts, Footage, frame, shown_ground
from swarm_mj.replay.log import LEAD_WINDOWS, Lead, Log
from swarm_mj.replay.palette import nice_top
from swarm_mj.replay.replay_size import AGE_BYTES, MAX_AGE_MATRIX_BYTES, in_matrix
from swarm_mj.simulation.components import components_in
from swarm_mj.simulation.rollout import WindowRecord
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.compiled import compiled

PIECE_WINDOWS = 25  # at least
FIRST_ROOM = 512  # windows that a recorder begins with room for


def check_observer(observer: int, num_robots: int) -> None:
    """Raise ValueError unless there is this robot, whose knowledge a replay shows."""
    is_whole = isinstance(observer, Integral) and not isinstance(observer, bool)
    if not is_whole or not 0 <= observer < num_robots:
        raise ValueError(f"observer must be from 0 to {num_robots - 1}, not {observer!r}")


class _Rows(NamedTuple):
    """The windows of a mission, with room for more: the first axis is the windows'.

    Each is a field of `Log`, of the same name.
    """

    position_m: Float[np.ndarray, "R N 2"]
    velocity_mps: Float[np.ndarray, "R N 2"]
    recipient: Int[np.ndarray, "R 2 N"]
    heard: Int[np.ndarray, "R 2 N"]
    is_on: Bool[np.ndarray, "R N"]
    believed_m: Float[np.ndarray, "R N 2"]
    ego_age: Float[np.ndarray, "R N"]
    known_age: Float[np.ndarray, "R N"]
    parent: Int[np.ndarray, "R N"]
    age_mean: Float[np.ndarray, "R"]
    age_std: Float[np.ndarray, "R"]
    age_max: Float[np.ndarray, "R"]
    velocity_variance_m2ps2: Float[np.ndarray, "R"]


class _BodyRows(NamedTuple):
    """The same of robots with bodies: what points do not have."""

    height_m: Float[np.ndarray, "R N"]
    attitude: Float[np.ndarray, "R N 4"]
    thrust: Float[np.ndarray, "R N 3"]
    wind_mps: Float[np.ndarray, "R 2"]


def _room_for_bodies(num_windows: int, num_robots: int) -> _BodyRows:
    robots = (num_windows, num_robots)
    return _BodyRows(
        height_m=np.empty(robots),
        attitude=np.empty((*robots, 4)),
        thrust=np.zeros((*robots, 3)),
        wind_mps=np.zeros((num_windows, PLANE)),
    )


def _room(num_windows: int, num_robots: int) -> _Rows:
    """Return room for windows; memory that is not written yet is not taken yet."""
    robots = (num_windows, num_robots)
    return _Rows(
        position_m=np.empty((*robots, 2)),
        velocity_mps=np.empty((*robots, 2)),
        recipient=np.empty((num_windows, 2, num_robots), dtype=np.int64),
        heard=np.empty((num_windows, 2, num_robots), dtype=np.int64),
        is_on=np.empty(robots, dtype=np.bool_),
        believed_m=np.empty((*robots, 2)),
        ego_age=np.empty(robots),
        known_age=np.empty(robots),
        parent=np.empty(robots, dtype=np.int32),
        age_mean=np.empty(num_windows),
        age_std=np.empty(num_windows),
        age_max=np.empty(num_windows),
        velocity_variance_m2ps2=np.empty(num_windows),
    )


def _copy_rows(kept: Iterable[np.ndarray], room: Iterable[np.ndarray]) -> None:
    """Copy arrays into larger ones, as their first rows."""
    for array, larger in zip(kept, room, strict=True):
        larger[: len(array)] = array


class _Compared(NamedTuple):
    """The fields of `Log` that are from snapshots of the radio, of which free space has none."""

    is_cut_off: Bool[np.ndarray, "T N"]
    mismatch: links.LinkMismatch
    num_believed: Int[np.ndarray, "C"]
    num_working: Int[np.ndarray, "C"]


class Recorder:
    """Copies what a replay shows from one of a swarm's missions, window by window."""

    def __init__(
        self, swarm: Swarm, *, ego: int = 0, index: int = 0, first_room: int = FIRST_ROOM
    ) -> None:
        """Prepare the record of what the ego robot knows; raise ValueError if there is none."""
        num_robots = swarm.mission.num_robots
        check_observer(ego, num_robots)
        self._in_matrix = in_matrix(num_robots)
        matrices_bytes = AGE_BYTES * len(self._in_matrix) ** 2 * swarm.mission.num_windows
        self._stride = max(1, int(np.ceil(matrices_bytes / MAX_AGE_MATRIX_BYTES)))
        self._radio_stride = links.stride_of(swarm, self._stride)
        self._swarm = swarm
        self._ego = ego
        self._index = index
        self._num_rows = 0  # whole ones
        self._rows = _room(first_room, num_robots)
        self._body_rows = None
        if swarm.mission.has_bodies:
            self._body_rows = _room_for_bodies(first_room, num_robots)
        self._age = self._room_for_ages(first_room)
        self._task_costs: list[TaskCost] = []
        self._snapshots: list[links.RadioSnapshot] = []  # none in free space
        self._all_on = np.ones(num_robots, dtype=np.bool_)

    def add(self, flown: WindowRecord | None = None) -> None:
        """Record the window that was just flown, if any, with its costs, if they are known."""
        row = self._num_rows
        if row == len(self._rows.age_mean):
            self._make_room()
        if row % self._radio_stride == 0:
            snapshot = links.radio_snapshot(self._swarm, self._index)
            if snapshot is not None:
                self._snapshots.append(snapshot)
        rows = self._rows
        rows.age_mean[row] = np.nan
        rows.velocity_variance_m2ps2[row] = np.nan
        if flown is not None:
            rows.age_mean[row] = flown.costs.age_windows[self._index]
            rows.velocity_variance_m2ps2[row] = flown.costs.velocity_variance_m2ps2[self._index]
            if flown.costs.task_cost is not None:
                self._task_costs.append(flown.costs.task_cost)
        self._copy_states(row)
        self._copy_ages(row)
        # It comes last: whatever an interrupt leaves unfinished, only whole windows count.
        self._num_rows = row + 1

    def _make_room(self) -> None:
        """Make room for twice as many windows."""
        num_robots = len(self._all_on)
        num_rows = 2 * len(self._rows.age_mean)
        age = self._room_for_ages(num_rows)
        _copy_rows([self._age], [age])
        self._age = age
        if self._body_rows is not None:
            body_rows = _room_for_bodies(num_rows, num_robots)
            _copy_rows(self._body_rows, body_rows)
            self._body_rows = body_rows
        # Last: by their number `add` tells whether there is room.
        rows = _room(num_rows, num_robots)
        _copy_rows(self._rows, rows)
        self._rows = rows

    def _room_for_ages(self, num_windows: int) -> Float32[np.ndarray, "K M M"]:
        """Return room for the age matrices of windows."""
        size = len(self._in_matrix)
        # Half the memory; the picture has 256 shades.
        return np.empty((-(-num_windows // self._stride), size, size), dtype=np.float32)

    def _copy_states(self, row: int) -> None:
        """Copy where the robots are and what they did, and what the ego robot knows."""
        swarm = self._swarm
        index = self._index
        rows = self._rows
        states = swarm.states
        buffers = swarm.buffers
        rows.position_m[row] = states.position_m[index, :, :PLANE]
        rows.velocity_mps[row] = states.velocity_mps[index, :, :PLANE]
        if self._body_rows is not None and states.attitude is not None:
            self._body_rows.height_m[row] = states.position_m[index, :, HEIGHT]
            self._body_rows.attitude[row] = states.attitude[index]
            if states.thrust is not None:
                self._body_rows.thrust[row] = states.thrust[index]
            if states.wind_mps is not None:
                self._body_rows.wind_mps[row] = states.wind_mps[index]
        rows.is_on[row] = self._all_on if states.is_active is None else states.is_active[index]
        rows.believed_m[row] = buffers.position_m[index, self._ego, :, :PLANE]
        rows.parent[row] = buffers.parent[index, self._ego]
        if not swarm.phases:  # silence, of a mission that has not begun
            rows.recipient[row] = np.arange(len(self._all_on))
            rows.heard[row] = np.arange(len(self._all_on))
        for slot, phase in enumerate(swarm.phases):
            rows.recipient[row, slot] = phase.recipient[index]
            rows.heard[row, slot] = phase.heard[index]

    def _copy_ages(self, row: int) -> None:
        """Copy the ages of all pairs, and what they come to."""
        index = self._index
        rows = self._rows
        buffers = self._swarm.buffers
        timestamp = buffers.timestamp[index]
        now = self._swarm.now[index]
        if row % self._stride == 0:
            _copy_matrix(timestamp, now, self._in_matrix.step, self._age[row // self._stride])
        _copy_own_ages(
            timestamp=timestamp[self._ego],
            is_granted=buffers.is_granted[index],
            now=now,
            ego_age=rows.ego_age[row],
            known_age=rows.known_age[row],
        )
        rows.age_std[row], rows.age_max[row] = _age_spread(timestamp, now, rows.is_on[row])

    @property
    def window_bytes(self) -> float:
        """The memory that a window takes, but for snapshots of the radio."""
        row_bytes = sum(array[0].nbytes for array in (*self._rows, *(self._body_rows or ())))
        return row_bytes + self._age[0].nbytes / self._stride

    @property
    def num_bytes(self) -> float:
        """The memory taken so far."""
        compared_bytes = sum(each.group.nbytes + each.links.nbytes for each in self._snapshots)
        return self._num_rows * self.window_bytes + compared_bytes

    @property
    def piece_windows(self) -> int:
        """The number of windows in a piece of the log, which begins with a snapshot if any do."""
        return self._radio_stride * -(-PIECE_WINDOWS // self._radio_stride)

    @property
    def num_windows(self) -> int:
        """The number of whole windows recorded."""
        return self._num_rows

    def piece(self, config: Mapping[str, Any], before: int, until: int) -> Log:
        """Return some of the windows; the pieces of a flight show what its whole log does.

        Args:
            config: For titles.
            before: The windows before them, a multiple of `piece_windows`.
            until: The last of them, counted from 1.
        """
        flown = _Rows(*(array[before:until] for array in self._rows))
        facts = self._facts(config)
        place_m = flown.position_m
        bodies: dict[str, np.ndarray] = {}  # of points, `Log` has none of these fields
        if self._body_rows is not None:
            body_rows = _BodyRows(*(array[before:until] for array in self._body_rows))
            place_m = links.lifted(flown.position_m, body_rows.height_m)
            bodies = body_rows._asdict()
            if not facts.mission.has_wind:
                del bodies["wind_mps"]
        lead = slice(max(0, before - LEAD_WINDOWS), before)
        compared = self._compared(flown.is_on, before)
        window = np.arange(before + 1, until + 1)
        matrices = slice(-(-before // self._stride), -(-until // self._stride))
        # An interrupt within `add` leaves one snapshot or cost too many.
        costs = self._task_costs[before:until]
        value = np.array([cost.value[self._index] for cost in costs])
        packets = links.fates(
            flown.recipient,
            flown.heard,
            place_m,
            is_broadcast=facts.is_broadcast,
        )
        return Log(
            facts=facts,
            window=window,
            packets=packets,
            ground=shown_ground(flown.position_m, facts.mission),
            scene=self._swarm.scene,
            lead=Lead(
                position_m=self._rows.position_m[lead],
                recipient=self._rows.recipient[lead],
                heard=self._rows.heard[lead],
            ),
            age_window=np.arange(matrices.start, matrices.stop) * self._stride + 1,
            age=self._age[matrices],
            task_cost=replace(costs[0], value=value) if costs else None,
            **flown._asdict(),
            **bodies,
            **compared._asdict(),
        )

    def log(self, config: Mapping[str, Any] | None = None) -> Log:
        """Return all that was recorded, `config` for titles; raise ValueError if it is nothing."""
        if self._num_rows == 0:
            raise ValueError("a replay needs at least 1 window flown, not 0")
        return self.piece(config or {}, 0, self._num_rows)

    def _facts(self, config: Mapping[str, Any]) -> Facts:
        mission = self._swarm.mission
        return Facts(
            mission=mission,
            policy=config.get("policy", ""),  # nothing names that of a picture, or of a training
            seed=config.get("seed", 0),
            observer=self._ego,
            is_broadcast=self._swarm.is_broadcast,
            # Darkest from about a round on, in which everyone has its turn. It is not of the ages
            # flown: all replays of a mission have one scale, also those that are not over yet.
            full_scale=nice_top(min(mission.num_robots, mission.num_windows)),
            **components_in(config).names,
        )

    def _compared(self, is_on: Bool[np.ndarray, "T N"], first: int) -> _Compared:
        window = np.arange(first + 1, first + len(is_on) + 1, self._radio_stride)
        before = first // self._radio_stride
        snapshots = self._snapshots[before : before + len(window)]
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
    recorder = Recorder(swarm, ego=observer, index=index, first_room=1)
    recorder.add()
    seen = recorder.log()
    # As wide wherever the team is: a live picture does not know where it will fly.
    half_side_m = swarm.mission.half_side_m
    ground = frame(seen.position_m, half_side_m)
    ground = replace(ground, reach_m=max(half_side_m, ground.reach_m))
    return replace(seen, ground=ground)


@compiled(makes_arrays=False)
def _copy_matrix(
    timestamp: Float[np.ndarray, "N N"], now: float, step: int, age: Float[np.ndarray, "M M"]
) -> None:
    """Fill in the ages of every step-th robot's news of such robots [windows]."""
    for row in range(len(age)):
        for column in range(len(age)):
            age[row, column] = now - timestamp[row * step, column * step]


@compiled(makes_arrays=False)
def _copy_own_ages(
    timestamp: Float[np.ndarray, "N"],
    is_granted: bool | np.bool_,
    now: float,
    ego_age: Float[np.ndarray, "N"],
    known_age: Float[np.ndarray, "N"],
) -> None:
    """Fill in the ages of one robot's news; `known_age` is nan where it knows nothing."""
    # In one call: of a row, each call of NumPy takes longer than what it does.
    for k in range(len(timestamp)):
        is_known = timestamp[k] > NEVER or is_granted
        ego_age[k] = now - timestamp[k]
        known_age[k] = ego_age[k] if is_known else np.nan


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
