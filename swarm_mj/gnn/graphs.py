"""A robot's buffer as a graph (III-A): nodes, and over the parent references, edges.

Index order: `[r, k]` is what the robot of row `r` knows about robot `k`; row `b N + i` is robot `i`
of mission `b`.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Shaped

from swarm_mj.mission import MISSION_DISTANCE_M, Mission
from swarm_mj.protocol.buffers import Buffers
from swarm_mj.protocol.local_views import LocalViews

REFERENCE_WINDOWS = 500.0  # what the authors' code divides times by, whatever the mission [windows]


@dataclass(frozen=True, kw_only=True)
class Graphs:
    """The graphs of R robots, each with a node for every robot of its team (III-A)."""

    node: Float32[np.ndarray, "R N F"]  # V: features, normalised
    parent: Int[np.ndarray, "R N"]  # P: the node that k's state came over first, or NO_PARENT
    may_address: Bool[np.ndarray, "R N"]  # recipients worth a thought; oneself, silence, always is
    has_turn: Bool[np.ndarray, "R"]  # whether a common order lets the robot speak now


class FeatureExtractor(ABC):
    """Makes graphs of local views; one that remembers packets must see every window."""

    names: ClassVar[tuple[str, ...]]  # of the features, in order; there are F
    uses: ClassVar[str] = "its buffer"  # what they are made of, in a few words

    def __init__(self, mission: Mission) -> None:
        """Takes the mission whose area, duration and range normalise the features."""
        self._mission = mission

    def start(self, num_missions: int, num_robots: int) -> None:  # noqa: B027 - most remember none
        """Forgets earlier missions, if it remembers any; now there are B of N robots."""

    @abstractmethod
    def graphs(self, views: LocalViews) -> Graphs:
        """What every robot's network sees now, row [b N + i] from view [b, i] only."""


def check_width(features: str, extractor: FeatureExtractor, graphs: Graphs) -> None:
    """Passes if an extractor, of the feature set of this name, names all numbers of its nodes.

    Raises:
        ValueError: It does not, as a user's own may.
    """
    named, found = len(extractor.names), graphs.node.shape[-1]
    if named != found:
        raise ValueError(f"{features} names {named} features, but its node has {found}")


class PaperFeatures(FeatureExtractor):
    """The paper's features: T, M and L, by the mission's area and duration.

    There is one difference: an explicit flag tells what was never heard of from what was observed
    at the start, and another the robot itself.
    """

    names: ClassVar[tuple[str, ...]] = (
        "is oneself", "is known", "T", "p_x", "p_y", "v_x", "v_y", "L",
    )  # fmt: skip

    def graphs(self, views: LocalViews) -> Graphs:
        """The buffers as they are; positions from the area's middle, velocities per mission."""
        buffers, mission = views.buffers, self._mission
        duration_s = mission.num_windows * mission.window_s
        is_oneself = np.broadcast_to(np.eye(views.num_robots, dtype=np.bool_), buffers.parent.shape)
        return _everyone_addressable(
            buffers,
            is_oneself,
            buffers.is_known | is_oneself,
            buffers.timestamp / mission.num_windows,
            buffers.position_m / mission.side_m,
            buffers.velocity_mps * (duration_s / mission.side_m),
            buffers.last_attempt / mission.num_windows,
        )


class ReferenceFeatures(FeatureExtractor):
    """The seven features of the authors' code, constants included.

    Ages are negative; positions and velocities are relative to the robot's own, also of robots
    never heard of, which count as if at rest in the middle of the area at the start.
    """

    names: ClassVar[tuple[str, ...]] = (
        "T - t", "zero", "p_x relative", "p_y relative", "v_x relative", "v_y relative", "L - t",
    )  # fmt: skip

    def graphs(self, views: LocalViews) -> Graphs:
        """The buffers as the authors' code shows them to its network."""
        buffers, now = views.buffers, views.now[:, None, None]
        return _everyone_addressable(
            buffers,
            (buffers.timestamp - now) / REFERENCE_WINDOWS,
            np.zeros(buffers.timestamp.shape),
            _from_own(buffers.position_m) / MISSION_DISTANCE_M,
            _from_own(buffers.velocity_mps) / MISSION_DISTANCE_M,
            (buffers.last_attempt - now) / REFERENCE_WINDOWS,
        )


def _from_own(vectors: Float[np.ndarray, "B N N axis"]) -> Float[np.ndarray, "B N N axis"]:
    """Each robot's vectors minus its own."""
    own = np.diagonal(vectors, axis1=1, axis2=2).swapaxes(1, 2)
    return vectors - own[:, :, None]


def _everyone_addressable(buffers: Buffers, *features: Shaped[np.ndarray, "B N N ..."]) -> Graphs:
    """Graphs with these features, numbers or vectors, in which every robot may be addressed."""
    num_missions, num_robots = buffers.shape
    rows = (num_missions * num_robots, num_robots)
    columns = [values.reshape(*rows, -1) for values in features]
    return Graphs(
        node=np.concatenate(columns, axis=2, dtype=np.float32, casting="same_kind"),
        parent=buffers.parent.reshape(rows),
        may_address=np.ones(rows, dtype=np.bool_),
        has_turn=np.zeros(rows[0], dtype=np.bool_),
    )
