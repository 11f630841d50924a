"""A robot's buffer as a graph (III-A): nodes, and over the parent references, edges.

Index order: `[r, k]` is what the robot of row `r` knows about robot `k`; row `b N + i` is robot `i`
of mission `b`.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float32, Int, Shaped

from swarm_mj.mission import MISSION_DISTANCE_M, Mission
from swarm_mj.protocol.buffers import Buffers
from swarm_mj.protocol.window import LocalViews

REFERENCE_WINDOWS = 500.0  # what the authors' code divides times by, whatever the mission [windows]


@dataclass(frozen=True, kw_only=True)
class Graphs:
    """The graphs of R robots, each with a node for every robot of its team (III-A)."""

    node: Float32[np.ndarray, "R N F"]  # V: features, normalised
    parent: Int[np.ndarray, "R N"]  # P: the node that k's state came over first, or NO_PARENT
    may_address: Bool[np.ndarray, "R N"]  # recipients to choose among; oneself, silence, always is
    has_turn: Bool[np.ndarray, "R"]  # whether a common order lets the robot speak now


class FeatureExtractor(ABC):
    """A maker of graphs of local views; one that remembers packets must see every window."""

    names: ClassVar[tuple[str, ...]]  # of the features, in order; there are F
    uses: ClassVar[str] = "its buffer"  # what they are made of, in a few words

    def __init__(self, mission: Mission) -> None:
        """Take the mission whose area, duration and range normalise the features."""
        self._mission = mission

    def start(self, num_missions: int, num_robots: int) -> None:  # noqa: B027 - most remember none
        """Forget earlier missions, if it remembers any; now there are B of N robots."""

    @abstractmethod
    def graphs(self, views: LocalViews) -> Graphs:
        """Return what every robot's network sees now, row [b N + i] from view [b, i] only."""


def check_width(features: str, extractor: FeatureExtractor, graphs: Graphs) -> None:
    """Raise ValueError unless an extractor names all numbers of its nodes; a user's own may not."""
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
        """Return the buffers; positions from the area's middle, velocities per mission."""
        mission, buffers = self._mission, views.buffers
        per_window, per_m = 1.0 / mission.num_windows, 1.0 / mission.side_m
        per_mps = mission.num_windows * mission.window_s / mission.side_m
        is_oneself = np.eye(views.num_robots, dtype=np.bool_)
        return _graphs_of(
            buffers,
            is_oneself,
            buffers.is_known | is_oneself,
            buffers.timestamp * per_window,
            *np.moveaxis(buffers.position_m * per_m, 3, 0),
            *np.moveaxis(buffers.velocity_mps * per_mps, 3, 0),
            buffers.last_attempt * per_window,
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
        """Return the buffers as the authors' code shows them to its network."""
        buffers, now = views.buffers, views.now[:, None, None]
        per_window, per_m = 1.0 / REFERENCE_WINDOWS, 1.0 / MISSION_DISTANCE_M
        own = np.arange(views.num_robots)
        from_own_m, from_own_mps = (
            state - state[:, own, own, None] for state in (buffers.position_m, buffers.velocity_mps)
        )
        return _graphs_of(
            buffers,
            (buffers.timestamp - now) * per_window,
            np.zeros(()),
            *np.moveaxis(from_own_m * per_m, 3, 0),
            *np.moveaxis(from_own_mps * per_m, 3, 0),  # they divide velocities by a distance, too
            (buffers.last_attempt - now) * per_window,
        )


def _graphs_of(buffers: Buffers, *features: Shaped[np.ndarray, "..."]) -> Graphs:
    """Return graphs of nodes with these features [b, i, k]; everyone may be addressed."""
    num_missions, num_robots = buffers.shape
    rows = num_missions * num_robots, num_robots
    node = np.empty((*buffers.timestamp.shape, len(features)), dtype=np.float32)
    for n, feature in enumerate(features):
        node[..., n] = feature
    return Graphs(
        node=node.reshape(*rows, -1),
        parent=buffers.parent.reshape(rows),
        may_address=np.ones(rows, dtype=np.bool_),
        has_turn=np.zeros(rows[0], dtype=np.bool_),
    )
