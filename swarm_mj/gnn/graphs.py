"""A robot's buffer as a graph (III-A): nodes, and over the parent references, edges.

Index order: `[r, k]` is what the robot of row `r` knows about robot `k`; row `b N + i` is robot `i`
of mission `b`.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float32, Int

from swarm_mj.mission import MISSION_DISTANCE_M, Mission
from swarm_mj.protocol.buffers import Buffers
from swarm_mj.protocol.local_views import LocalViews

FeatureSet = Literal["paper", "reference", "local", "extended"]
REFERENCE_WINDOWS = 500.0  # what the authors' code divides times by, whatever the mission [windows]


@dataclass(frozen=True, kw_only=True)
class Graphs:
    """The graphs of R robots, each with a node for every robot of its team (III-A)."""

    node: Float32[np.ndarray, "R N F"]  # V: features, normalised
    parent: Int[np.ndarray, "R N"]  # P: the node that k's state came over first, or NO_PARENT
    may_address: Bool[np.ndarray, "R N"]  # recipients worth a thought; oneself, silence, always is
    has_turn: Bool[np.ndarray, "R"]  # whether a common order lets the robot speak now


@runtime_checkable
class Observer(Protocol):
    """Makes graphs of local views; one that remembers packets must see every window."""

    names: ClassVar[tuple[str, ...]]  # of the features, in order; there are F

    def start(self, num_missions: int, num_robots: int) -> None:
        """Forgets earlier missions.

        Args:
            num_missions: B.
            num_robots: N.
        """
        ...

    def graphs(self, views: LocalViews) -> Graphs:
        """What every robot's network sees now, row [b N + i] from view [b, i] only.

        Args:
            views: All robots' views, side by side.

        Returns:
            The graphs of B N robots.
        """
        ...


class PaperObserver:
    """The paper's features: T, M and L, by the mission's area and duration.

    There is one difference: an explicit flag tells what was never heard of from what was observed
    at the start, and another the robot itself.
    """

    names: ClassVar[tuple[str, ...]] = (
        "is oneself", "is known", "T", "p_x", "p_y", "v_x", "v_y", "L",
    )  # fmt: skip

    def __init__(self, mission: Mission) -> None:
        """Takes the mission's duration and the side of its area."""
        self._num_windows = mission.num_windows
        self._side_m = mission.side_m
        self._duration_s = mission.num_windows * mission.window_s

    def start(self, num_missions: int, num_robots: int) -> None:
        """Nothing is remembered; arguments as in `Observer.start`."""

    def graphs(self, views: LocalViews) -> Graphs:
        """The buffers as they are; positions from the area's middle, velocities per mission."""
        buffers = views.buffers
        num_missions, num_robots = buffers.shape
        node = np.empty((num_missions, num_robots, num_robots, len(self.names)), dtype=np.float32)
        node[..., 0] = np.eye(num_robots)
        node[..., 1] = buffers.is_known | np.eye(num_robots, dtype=np.bool_)
        node[..., 2] = buffers.timestamp / self._num_windows
        node[..., 3:5] = buffers.position_m / self._side_m
        node[..., 5:7] = buffers.velocity_mps * (self._duration_s / self._side_m)
        node[..., 7] = buffers.last_attempt / self._num_windows
        return everyone_addressable(node, buffers)


class ReferenceObserver:
    """The seven features of the authors' code, constants included.

    Ages are negative; positions and velocities are relative to the robot's own, also of robots
    never heard of, which count as if at rest in the middle of the area at the start.
    """

    names: ClassVar[tuple[str, ...]] = (
        "T - t", "zero", "p_x relative", "p_y relative", "v_x relative", "v_y relative", "L - t",
    )  # fmt: skip

    def __init__(self, mission: Mission) -> None:
        """Takes nothing from the mission."""

    def start(self, num_missions: int, num_robots: int) -> None:
        """Nothing is remembered; arguments as in `Observer.start`."""

    def graphs(self, views: LocalViews) -> Graphs:
        """The buffers as the authors' code shows them to its network."""
        buffers = views.buffers
        num_missions, num_robots = buffers.shape
        now = views.now[:, None, None]
        oneself = np.arange(num_robots)
        own_position_m = buffers.position_m[:, oneself, oneself][:, :, None]
        own_velocity_mps = buffers.velocity_mps[:, oneself, oneself][:, :, None]
        node = np.zeros((num_missions, num_robots, num_robots, len(self.names)), dtype=np.float32)
        node[..., 0] = (buffers.timestamp - now) / REFERENCE_WINDOWS
        node[..., 2:4] = (buffers.position_m - own_position_m) / MISSION_DISTANCE_M
        node[..., 4:6] = (buffers.velocity_mps - own_velocity_mps) / MISSION_DISTANCE_M
        node[..., 6] = (buffers.last_attempt - now) / REFERENCE_WINDOWS
        return everyone_addressable(node, buffers)


def everyone_addressable(node: Float32[np.ndarray, "B N N F"], buffers: Buffers) -> Graphs:
    """Graphs in which every robot may be addressed."""
    num_missions, num_robots, _, num_features = node.shape
    rows = (num_missions * num_robots, num_robots)
    return Graphs(
        node=node.reshape(*rows, num_features),
        parent=buffers.parent.reshape(rows),
        may_address=np.ones(rows, dtype=np.bool_),
        has_turn=np.zeros(rows[0], dtype=np.bool_),
    )
