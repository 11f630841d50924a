"""The record of a flight for its replay: one mission's windows as plain arrays."""

from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Integral

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission import Mission
from swarm_mj.physics.scene import Scene
from swarm_mj.protocol.buffers import NO_PARENT
from swarm_mj.protocol.costs import TaskCost
from swarm_mj.replay.links import (
    LinkMismatch,
    PacketLinks,
    fates,
    is_other,
    radio_snapshot,
    stride_of,
)
from swarm_mj.simulation.rollout import WindowRecord
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.needs import GB

# Longer or larger flights keep the age matrix of every k-th window only.
MAX_AGE_MATRIX_BYTES = 64e6
AGE_BYTES = 4  # float32
# Fits of measured peaks and files: of rerun itself, of each window, of each robot in it; and of the
# age matrices, which are copied in memory and compressed in the file.
RERUN_BYTES, WINDOW_BYTES, ROBOT_BYTES, MATRIX_COPIES = 0.1 * GB, 15e3, 1e3, 2.2
BLUEPRINT_BYTES, WINDOW_FILE_BYTES, ROBOT_FILE_BYTES, MATRIX_SHARE = 0.5e6, 500.0, 150.0, 0.25


@dataclass(frozen=True, kw_only=True)
class Log:
    """T windows of one mission of N robots, each at its end; packets flew during it.

    Ages are those of the whole team; positions believed, and parents, are the ego robot's.
    """

    ego: int
    window: Int[np.ndarray, "T"]  # 1 is the mission's first window
    position_m: Float[np.ndarray, "T N 2"]  # p [m]
    velocity_mps: Float[np.ndarray, "T N 2"]  # v [m/s]
    recipient: Int[np.ndarray, "T 2 N"]  # S^i in both phases; itself: silent
    is_on: Bool[np.ndarray, "T N"]  # whether a robot had not failed
    heard: Int[np.ndarray, "T 2 N"]  # the sender that robot j decoded in both phases; itself: none
    is_broadcast: bool  # packets have no addressee; otherwise the second phase answers the first
    is_known: Bool[np.ndarray, "T N"]  # whether the ego robot has heard of j
    believed_m: Float[np.ndarray, "T N 2"]  # M: where j was, as the ego robot knows it [m]
    ego_age: Float[np.ndarray, "T N"]  # t - T^{ego,j} [windows]
    parent: Int[np.ndarray, "T N"]  # P^{ego,j}
    age_window: Int[np.ndarray, "K"]  # the windows of the age matrix, every stride-th
    age: Float[np.ndarray, "K N N"]  # t - T^{i,j} [windows]
    age_mean: Float[np.ndarray, "T"]  # Eq. 10 [windows]
    age_std: Float[np.ndarray, "T"]  # over all pairs of different robots that are on [windows]
    age_max: Float[np.ndarray, "T"]  # the worst pair's [windows]
    velocity_variance_m2ps2: Float[np.ndarray, "T"]  # Eq. 17
    scene: Scene | None = None  # what changed the arena, if anything did
    task_cost: TaskCost | None = None  # one value a window; None if the controller has none
    group: Int[np.ndarray, "T N"] | None = None  # the first robot of each one's connected group
    num_believed: Int[np.ndarray, "T"] | None = None  # links that policies believe in
    num_working: Int[np.ndarray, "T"] | None = None  # links whose packets decode but for fades
    mismatch: LinkMismatch | None = None  # all four are None in free space

    @cached_property
    def packets(self) -> dict[str, PacketLinks]:
        """All packets by their fate."""
        return fates(self.recipient, self.heard, is_broadcast=self.is_broadcast)

    @property
    def is_transmitter(self) -> Bool[np.ndarray, "T N"]:
        """True if a robot sent a request, or a broadcast in either phase."""
        return np.any(is_other(self.recipient)[:, : 2 if self.is_broadcast else 1], axis=1)

    @property
    def has_motion(self) -> bool:
        """True if any robot moves."""
        return bool(np.any(self.velocity_mps))

    @property
    def known_age(self) -> Float[np.ndarray, "T N"]:
        """The ego robot's ages, nan of robots that it has not heard of [windows]."""
        return np.where(self.is_known, self.ego_age, np.nan)

    @property
    def is_other_known(self) -> Bool[np.ndarray, "T N"]:
        """True if the ego robot has heard of j, which is not itself."""
        return self.is_known & (np.arange(self.is_known.shape[1]) != self.ego)

    @property
    def has_parent(self) -> Bool[np.ndarray, "T N"]:
        """True if the ego robot's entry of j came over the radio."""
        return self.is_other_known & (self.parent != NO_PARENT)

    @property
    def is_cut_off(self) -> Bool[np.ndarray, "T N"]:
        """True if a robot cannot exchange packets with the ego robot, over any number of hops."""
        if self.group is None:
            return np.zeros(self.is_on.shape, dtype=bool)
        is_apart = self.group != self.group[:, [self.ego]]
        return is_apart & self.is_on & self.is_on[:, [self.ego]]


class Recorder:
    """Copies what a replay shows from one of a swarm's missions, window by window."""

    def __init__(self, swarm: Swarm, *, ego: int = 0, index: int = 0) -> None:
        """Prepare the record of what the ego robot knows; raise ValueError if there is none."""
        num_robots = swarm.mission.num_robots
        if not isinstance(ego, Integral) or not 0 <= ego < num_robots:
            raise ValueError(f"observer must be from 0 to {num_robots - 1}, not {ego!r}")
        matrices_bytes = AGE_BYTES * num_robots**2 * swarm.mission.num_windows
        self._stride = max(1, int(np.ceil(matrices_bytes / MAX_AGE_MATRIX_BYTES)))
        self._radio_stride = stride_of(swarm, self._stride)
        self._swarm, self._ego, self._index = swarm, ego, index
        self._rows: list[dict[str, np.ndarray]] = []
        self._age: list[np.ndarray] = []
        self._task_costs: list[TaskCost] = []
        self._links: list[np.ndarray] = []  # that differ, of each snapshot
        self._radio: dict[str, object] = {}  # of the last snapshot, which stands until the next

    def add(self, flown: WindowRecord | None = None) -> None:
        """Record the window that was just flown, if any, with its costs, if they are known."""
        swarm, index, own = self._swarm, self._index, self._ego
        buffers, states, phases = swarm.buffers, swarm.states, swarm.phases
        age = swarm.now[index] - buffers.timestamp[index]
        costs, robots = None if flown is None else flown.costs, np.arange(len(age))
        is_on = np.ones(len(age), bool) if states.is_active is None else states.is_active[index]
        others = age[is_on[:, None] & is_on & (robots[:, None] != robots)]
        if len(self._rows) % self._stride == 0:
            self._age.append(age.astype(np.float32))
        is_due = len(self._rows) % self._radio_stride == 0
        if is_due and (seen := radio_snapshot(swarm, index)) is not None:
            seen.links["row"] = len(self._links)
            self._links.append(seen.links)
            self._radio = {name: its for name, its in seen._asdict().items() if name != "links"}
        if costs is not None and costs.task_cost is not None:
            self._task_costs.append(costs.task_cost)
        silence = [robots, robots]  # of a mission that has not begun
        no_cost = np.full(len(swarm.now), np.nan)
        variance = no_cost if costs is None else costs.velocity_variance_m2ps2
        shown = {
            "position_m": states.position_m[index],
            "velocity_mps": states.velocity_mps[index],
            "recipient": [phase.recipient[index] for phase in phases] or silence,
            "heard": [phase.heard[index] for phase in phases] or silence,
            "is_on": is_on,
            "is_known": buffers.is_known[index, own],
            "believed_m": buffers.position_m[index, own],
            "ego_age": age[own],
            "parent": buffers.parent[index, own],
            "age_mean": (no_cost if costs is None else costs.age_windows)[index],
            "age_std": np.std(others),
            "age_max": np.max(others),
            "velocity_variance_m2ps2": variance[index],
            **self._radio,
        }
        # Copies: the swarm writes its arrays in place, and a view would keep a whole matrix. The
        # row comes last: whatever an interrupt leaves unfinished, rows count the whole windows.
        self._rows.append({name: np.array(value) for name, value in shown.items()})

    @property
    def num_bytes(self) -> int:
        """The memory taken so far; every window takes the same."""
        row = sum(value.nbytes for value in self._rows[0].values()) if self._rows else 0
        return len(self._rows) * row + sum(each.nbytes for each in (*self._age, *self._links))

    def log(self) -> Log:
        """Return everything recorded so far; raise ValueError if that is nothing."""
        if not self._rows:
            raise ValueError("a replay needs at least 1 window flown, not 0")
        columns = {name: np.stack([row[name] for row in self._rows]) for name in self._rows[0]}
        window = np.arange(1, len(self._rows) + 1)
        age_window, seen = window[:: self._stride], window[:: self._radio_stride]
        # An interrupt within `add` leaves one matrix, snapshot or cost too many.
        costs, links = self._task_costs[: len(window)], self._links[: len(seen)]
        value = np.array([cost.value[self._index] for cost in costs])
        return Log(
            ego=self._ego,
            window=window,
            is_broadcast=self._swarm.is_broadcast,
            scene=self._swarm.scene,
            age_window=age_window,
            age=np.stack(self._age[: len(age_window)]),
            task_cost=replace(costs[0], value=value) if costs else None,
            mismatch=LinkMismatch(seen, np.concatenate(links)) if links else None,
            **columns,
        )


def replay_memory(mission: Mission, num_windows: int) -> float:
    """Return the memory that recording takes at its peak, when the replay is written."""
    matrices = min(MAX_AGE_MATRIX_BYTES, AGE_BYTES * num_windows * mission.num_robots**2)
    a_window = WINDOW_BYTES + ROBOT_BYTES * mission.num_robots
    return RERUN_BYTES + a_window * num_windows + MATRIX_COPIES * matrices


def replay_file(mission: Mission) -> float:
    """Return a replay's size, of teams that move; others' are smaller."""
    matrices = min(MAX_AGE_MATRIX_BYTES, AGE_BYTES * mission.num_windows * mission.num_robots**2)
    a_window = WINDOW_FILE_BYTES + ROBOT_FILE_BYTES * mission.num_robots
    return BLUEPRINT_BYTES + a_window * mission.num_windows + MATRIX_SHARE * matrices
