"""A robot's buffer as a graph (III-A): nodes, and over the parent references, edges.

Index order: `[r, k]` is what the robot of row `r` knows about robot `k`; row `b N + i` is robot `i`
of mission `b`.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Shaped

from swarm_mj.mission import MISSION_DISTANCE_M, Mission
from swarm_mj.policies.gnn.features import Feature, dtype_of, names_of
from swarm_mj.protocol.window import LocalViews
from swarm_mj.system.compiled import compiled

REFERENCE_WINDOWS = 500.0  # what the authors' code divides times by, whatever the mission [windows]


@dataclass(frozen=True, kw_only=True)
class Graphs:
    """The graphs of R robots, each with a node for every robot of its team (III-A).

    Row `b N + i` is what robot i of mission b sees, and may follow from that robot's view only.

    Args:
        node: F numbers for each teammate, in the order of the extractor's `names`.
        parent: The node that its state came over first, or -1; it makes the edges.
        may_address: Recipients to choose among. Oneself, which is silence, must be one.
        has_turn: Whether a common order lets the robot speak now; if not, a policy adds its
            `silence_logit` to silence.
    """

    node: Float32[np.ndarray, "R N F"]  # V: features, normalised
    parent: Int[np.ndarray, "R N"]  # P: the node that k's state came over first, or NO_PARENT
    may_address: Bool[np.ndarray, "R N"]  # recipients to choose among; oneself, silence, always is
    has_turn: Bool[np.ndarray, "R"]  # whether a common order lets the robot speak now


class FeatureExtractor(ABC):
    """A maker of graphs of local views; one that remembers packets must see every window.

    Policies and trainings take a subclass of yours as `--features module:Name`. Their files keep
    the names, in order: a network flies only with the features that it was trained on.

    Example:
        >>> class Ages(FeatureExtractor):
        ...     names = ("age",)
        ...
        ...     def graphs(self, views):
        ...         age = views.now[:, None, None] - views.buffers.timestamp
        ...         node = age.reshape(-1, views.num_robots, 1).astype(np.float32)
        ...         return Graphs(
        ...             node=node,
        ...             parent=views.buffers.parent.reshape(node.shape[:2]),
        ...             may_address=np.ones(node.shape[:2], dtype=bool),
        ...             has_turn=np.zeros(len(node), dtype=bool),
        ...         )
    """

    names: ClassVar[tuple[str, ...]]  # of the features, in order; there are F
    uses: ClassVar[str] = "its buffer"  # what they are made of, in a few words
    remembers_packets: ClassVar[bool] = False  # whether it keeps N² numbers for each robot
    gives_turns: ClassVar[bool] = False  # whether an order of the team and the clock let one speak

    def __init__(self, mission: Mission) -> None:
        """Take the mission whose area, duration and range normalise the features."""
        self._mission = mission

    def start(self, num_missions: int, num_robots: int) -> None:  # noqa: B027 - most remember none
        """Forget earlier missions, if it remembers any.

        Args:
            num_missions: Missions that now begin side by side, B.
            num_robots: Robots in each of them, N.
        """

    @abstractmethod
    def graphs(self, views: LocalViews) -> Graphs:
        """Return what every robot's network sees now.

        Args:
            views: The buffers of all robots, the time [windows] and what was just heard.

        Returns:
            A graph for each robot: row `b N + i` from view `[b, i]` only.
        """


def check_width(features: str, extractor: FeatureExtractor, graphs: Graphs) -> None:
    """Raise ValueError unless an extractor names all numbers of its nodes; a user's own may not."""
    named = len(extractor.names)
    found = graphs.node.shape[-1]
    if named != found:
        raise ValueError(f"{features} names {named} features, but its node has {found}")


class PaperNode:
    """A node's knowledge of a teammate, in the network's order."""

    is_oneself: Annotated[float, Feature("is oneself")]
    is_known: Annotated[float, Feature("is known")]
    timestamp: Annotated[float, Feature("T")]
    x: Annotated[float, Feature("p_x")]
    y: Annotated[float, Feature("p_y")]
    velocity_x: Annotated[float, Feature("v_x")]
    velocity_y: Annotated[float, Feature("v_y")]
    last_attempt: Annotated[float, Feature("L")]


PAPER_NODE = dtype_of(PaperNode)


class PaperFeatures(FeatureExtractor):
    """The paper's features: T, M and L, by the mission's area and duration.

    There is one difference: an explicit flag tells what was never heard of from what was observed
    at the start, and another the robot itself.
    """

    names: ClassVar[tuple[str, ...]] = names_of(PaperNode)

    def graphs(self, views: LocalViews) -> Graphs:
        """Return the buffers; positions from the area's middle, velocities per mission."""
        mission = self._mission
        buffers = views.buffers
        is_oneself = np.eye(views.num_robots, dtype=np.bool_)
        node = np.empty(buffers.timestamp.shape, dtype=PAPER_NODE)
        node["is_oneself"] = is_oneself
        node["is_known"] = buffers.is_known | is_oneself
        scale = Scale(
            per_window=1.0 / mission.num_windows,
            per_m=1.0 / mission.side_m,
            per_mps=mission.num_windows * mission.window_s / mission.side_m,
        )
        return _with_state(node, views, is_relative=False, scale=scale)


class ReferenceNode:
    """A node's knowledge of a teammate, in the order of the authors' code."""

    timestamp: Annotated[float, Feature("T - t")]
    zero: Annotated[float, Feature("zero")]
    x: Annotated[float, Feature("p_x relative")]
    y: Annotated[float, Feature("p_y relative")]
    velocity_x: Annotated[float, Feature("v_x relative")]
    velocity_y: Annotated[float, Feature("v_y relative")]
    last_attempt: Annotated[float, Feature("L - t")]


REFERENCE_NODE = dtype_of(ReferenceNode)


class ReferenceFeatures(FeatureExtractor):
    """The seven features of the authors' code, constants included.

    Ages are negative; positions and velocities are relative to the robot's own, also of robots
    never heard of, which count as if at rest in the middle of the area at the start.
    """

    names: ClassVar[tuple[str, ...]] = names_of(ReferenceNode)

    def graphs(self, views: LocalViews) -> Graphs:
        """Return the buffers as the authors' code shows them to its network."""
        node = np.empty(views.buffers.timestamp.shape, dtype=REFERENCE_NODE)
        node["zero"] = 0.0
        per_m = 1.0 / MISSION_DISTANCE_M  # they divide velocities by a distance, too
        scale = Scale(per_window=1.0 / REFERENCE_WINDOWS, per_m=per_m, per_mps=per_m)
        return _with_state(node, views, is_relative=True, scale=scale)


class Scale(NamedTuple):
    """Factors that times, positions and velocities are multiplied by."""

    per_window: float
    per_m: float
    per_mps: float


def _with_state(
    node: Shaped[np.ndarray, "B N N"], views: LocalViews, *, is_relative: bool, scale: Scale
) -> Graphs:
    """Write what the buffers hold into nodes; in their graphs everyone may be addressed."""
    buffers = views.buffers
    _write_state(
        timestamp=buffers.timestamp,
        last_attempt=buffers.last_attempt,
        position_m=buffers.position_m,
        velocity_mps=buffers.velocity_mps,
        now=views.now,
        is_relative=is_relative,
        scale=scale,
        node=node,
    )
    num_missions, num_robots = buffers.shape
    rows = (num_missions * num_robots, num_robots)
    return Graphs(
        node=node.view(np.float32).reshape(*rows, -1),
        parent=buffers.parent.reshape(rows),
        may_address=np.ones(rows, dtype=np.bool_),
        has_turn=np.zeros(rows[0], dtype=np.bool_),
    )


@compiled()
def _write_state(
    timestamp: Float[np.ndarray, "B N N"],
    last_attempt: Float[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N N D"],
    velocity_mps: Float[np.ndarray, "B N N D"],
    now: Float[np.ndarray, "B"],
    is_relative: bool,
    scale: Scale,
    node: Shaped[np.ndarray, "B N N"],
) -> None:
    """Write times and states to scale, relative to now and to the robot's own states or not."""
    # One compiled pass: whole arrays, one operation after the other, took up to six times as long.
    num_missions, num_robots = timestamp.shape[:2]
    for b in range(num_missions):
        for i in range(num_robots):
            t = x_m = y_m = x_mps = y_mps = 0.0
            if is_relative:
                t = now[b]
                x_m = position_m[b, i, i, 0]
                y_m = position_m[b, i, i, 1]
                x_mps = velocity_mps[b, i, i, 0]
                y_mps = velocity_mps[b, i, i, 1]
            for k in range(num_robots):
                of_k: PaperNode | ReferenceNode = node[b, i, k]
                of_k.timestamp = (timestamp[b, i, k] - t) * scale.per_window
                of_k.x = (position_m[b, i, k, 0] - x_m) * scale.per_m
                of_k.y = (position_m[b, i, k, 1] - y_m) * scale.per_m
                of_k.velocity_x = (velocity_mps[b, i, k, 0] - x_mps) * scale.per_mps
                of_k.velocity_y = (velocity_mps[b, i, k, 1] - y_mps) * scale.per_mps
                of_k.last_attempt = (last_attempt[b, i, k] - t) * scale.per_window
