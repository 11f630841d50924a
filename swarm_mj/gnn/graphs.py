"""A robot's buffer as a graph (III-A): nodes, and over the parent references, edges.

Index order: `[r, k]` is what the robot of row `r` knows about robot `k`; row `b N + i` is robot `i`
of mission `b`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

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
class FeatureExtractor(Protocol):
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


class PaperFeatures:
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
        """Nothing is remembered; arguments as in `FeatureExtractor.start`."""

    def graphs(self, views: LocalViews) -> Graphs:
        """The buffers as they are; positions from the area's middle, velocities per mission."""
        buffers = views.buffers
        is_oneself = np.eye(buffers.shape[1], dtype=np.bool_)
        position = np.moveaxis(buffers.position_m / self._side_m, -1, 0)
        velocity = np.moveaxis(buffers.velocity_mps * (self._duration_s / self._side_m), -1, 0)
        features = {
            "is oneself": is_oneself,
            "is known": buffers.is_known | is_oneself,
            "T": buffers.timestamp / self._num_windows,
            "p_x": position[0],
            "p_y": position[1],
            "v_x": velocity[0],
            "v_y": velocity[1],
            "L": buffers.last_attempt / self._num_windows,
        }
        return everyone_addressable([features[name] for name in self.names], buffers)


class ReferenceFeatures:
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
        """Nothing is remembered; arguments as in `FeatureExtractor.start`."""

    def graphs(self, views: LocalViews) -> Graphs:
        """The buffers as the authors' code shows them to its network."""
        buffers, now = views.buffers, views.now[:, None, None]
        position = _from_own(buffers.position_m) / MISSION_DISTANCE_M
        velocity = _from_own(buffers.velocity_mps) / MISSION_DISTANCE_M
        features = {
            "T - t": (buffers.timestamp - now) / REFERENCE_WINDOWS,
            "zero": np.zeros(buffers.timestamp.shape),
            "p_x relative": position[0],
            "p_y relative": position[1],
            "v_x relative": velocity[0],
            "v_y relative": velocity[1],
            "L - t": (buffers.last_attempt - now) / REFERENCE_WINDOWS,
        }
        return everyone_addressable([features[name] for name in self.names], buffers)


def _from_own(
    vectors: Float[np.ndarray, "B N N axis"],
) -> Float[np.ndarray, "axis B N N"]:
    """Each robot's vectors minus its own, axis by axis."""
    own = np.diagonal(vectors, axis1=1, axis2=2).swapaxes(1, 2)
    return np.moveaxis(vectors - own[:, :, None], -1, 0)


def everyone_addressable(features: Sequence[np.ndarray], buffers: Buffers) -> Graphs:
    """Graphs with these features, in order, in which every robot may be addressed."""
    num_missions, num_robots = buffers.shape
    rows = (num_missions * num_robots, num_robots)
    node = np.empty((*buffers.timestamp.shape, len(features)), dtype=np.float32)
    for k, values in enumerate(features):
        node[..., k] = values
    return Graphs(
        node=node.reshape(*rows, len(features)),
        parent=buffers.parent.reshape(rows),
        may_address=np.ones(rows, dtype=np.bool_),
        has_turn=np.zeros(rows[0], dtype=np.bool_),
    )
