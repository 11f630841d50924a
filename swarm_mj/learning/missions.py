"""Missions side by side for training: groups that end at different times, teams of several sizes.

A group is one swarm: its missions have one team size and begin and end together. Groups are
staggered, so that every rollout holds windows from all parts of a mission. A row is one robot of
one mission; rows run group by group, mission by mission, robot by robot.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.gnn.feature_sets import make_extractor
from swarm_mj.gnn.graphs import FeatureExtractor, Graphs
from swarm_mj.learning.credit import credits_of
from swarm_mj.mission import Mission
from swarm_mj.protocol.buffers import NO_PARENT
from swarm_mj.swarm import Swarm

FIRST_TRAINING_SEED = 2**40  # training draws seeds from here on, so that small ones are never seen
LAST_TRAINING_SEED = 2**62


@dataclass(frozen=True, kw_only=True)
class Course:
    """How a group came to where it is: flown again, it leads to the same state."""

    seeds: list[int]  # of the missions under way
    last_window: int  # when they end [windows]
    recipients: Int[np.ndarray, "windows B N"]  # so far


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What one window of a group brought."""

    credit: Float[np.ndarray, "B N"]  # ages removed by each robot [windows]; 0 unless asked for
    age_windows: Float[np.ndarray, "B"]  # Eq. 10 [windows]
    velocity_variance_m2ps2: Float[np.ndarray, "B"]  # Eq. 17 [m²/s²]
    attempted: Float[np.ndarray, "B"]  # packets
    delivered: Float[np.ndarray, "B"]
    graphs: Graphs  # what the robots see next; of new missions if these ended
    last_graphs: Graphs | None  # what they saw at the end, if the missions ended here
    is_cut: bool  # whether they ended before the mission did, to stagger the groups


class Group:
    """Missions of one team size that begin and end together."""

    def __init__(
        self,
        mission: Mission,
        features: str,
        num_missions: int,
        rng: np.random.Generator,
        *,
        first_windows: int,
    ) -> None:
        """Starts the first missions.

        Args:
            mission: What they have in common.
            features: Name of the feature set.
            num_missions: B.
            rng: Draws the missions' seeds.
            first_windows: Where the first missions are cut off [windows].
        """
        self.mission = mission
        self._rng = rng
        self.num_missions = num_missions
        self._extractor: FeatureExtractor = make_extractor(features, mission)
        self._last_window = first_windows
        self._seeds = self._draw_seeds()
        self._swarm = Swarm(mission, self._seeds)
        self._begin()

    @property
    def num_features(self) -> int:
        """F."""
        return self.first_graphs.node.shape[2]

    def step(self, recipient: Int[np.ndarray, "B N"], *, with_credit: bool) -> Outcome:
        """One window; missions that end start anew."""
        swarm = self._swarm
        before, now = swarm.buffers.timestamp.copy(), swarm.now
        costs = swarm.exchange(recipient)
        credit = np.zeros(recipient.shape)
        if with_credit:
            credit = credits_of(before, swarm.states.position_m, recipient, swarm.channel, now)
        self._recipients.append(recipient.astype(np.int16))
        graphs, last_graphs = self._extractor.graphs(swarm.views), None
        is_cut = self._last_window < self.mission.num_windows
        if swarm.now[0] >= self._last_window:
            last_graphs = graphs
            self._last_window = self.mission.num_windows
            self._seeds = self._draw_seeds()
            swarm.restart(self._seeds)
            graphs = self._begin()
        return Outcome(
            credit=credit,
            age_windows=costs.age_windows,
            velocity_variance_m2ps2=costs.velocity_variance_m2ps2,
            attempted=costs.packets.attempted,
            delivered=costs.packets.delivered,
            graphs=graphs,
            last_graphs=last_graphs,
            is_cut=is_cut and last_graphs is not None,
        )

    def course(self) -> Course:
        """What `fly_again` needs."""
        teams = (self.num_missions, self.mission.num_robots)
        recipients = np.array(self._recipients, dtype=np.int16).reshape(-1, *teams)
        return Course(seeds=list(self._seeds), last_window=self._last_window, recipients=recipients)

    def fly_again(self, course: Course) -> Graphs:
        """Goes to the end of a course; returns what the robots see there."""
        self._seeds, self._last_window = list(course.seeds), course.last_window
        self._swarm.restart(self._seeds)
        graphs = self._begin()
        for recipient in course.recipients:
            self._swarm.exchange(recipient.astype(np.int64))
            self._recipients.append(recipient)
            graphs = self._extractor.graphs(self._swarm.views)
        return graphs

    def _begin(self) -> Graphs:
        """What the robots see at the start of new missions."""
        self._recipients: list[Int[np.ndarray, "B N"]] = []
        self._extractor.start(self.num_missions, self.mission.num_robots)
        self.first_graphs = self._extractor.graphs(self._swarm.views)
        return self.first_graphs

    def _draw_seeds(self) -> list[int]:
        drawn = self._rng.integers(FIRST_TRAINING_SEED, LAST_TRAINING_SEED, size=self.num_missions)
        return [int(seed) for seed in drawn]


def make_groups(
    mission: Mission,
    team_sizes: Sequence[int],
    features: str,
    num_missions: int,
    num_groups: int,
    rng: np.random.Generator,
) -> list[Group]:
    """Groups whose first missions are cut at different windows, sizes in turn.

    Args:
        mission: What all missions have in common but for the team's size.
        team_sizes: Of the teams; group g has the one at place g mod their number.
        features: Name of the feature set.
        num_missions: In all groups together.
        num_groups: Into which the missions are shared out evenly.
        rng: Draws the missions' seeds.

    Returns:
        The groups.

    Raises:
        ValueError: The missions cannot be shared out evenly, or a size would have no group.
    """
    if num_missions % num_groups or not 1 <= len(team_sizes) <= num_groups <= num_missions:
        raise ValueError(
            f"missions must be a multiple of their {num_groups} groups, of which each of the "
            f"{len(team_sizes)} team sizes needs one, not {num_missions}"
        )
    return [
        Group(
            replace(mission, num_robots=team_sizes[group % len(team_sizes)]),
            features,
            num_missions // num_groups,
            rng,
            first_windows=max(1, mission.num_windows * (group + 1) // num_groups),
        )
        for group in range(num_groups)
    ]


def padded(graphs: Sequence[Graphs], num_nodes: int) -> dict[str, np.ndarray]:
    """All groups' graphs in one batch, with unconnected nodes that nobody may address.

    Args:
        graphs: One a group, of at most M nodes.
        num_nodes: M.

    Returns:
        The arrays of `Graphs` by name, R rows of M nodes; `has_turn` is [R, 1].
    """
    num_rows = sum(len(each.node) for each in graphs)
    node = np.zeros((num_rows, num_nodes, graphs[0].node.shape[2]), dtype=np.float32)
    parent = np.full((num_rows, num_nodes), NO_PARENT, dtype=np.int32)
    may_address = np.zeros((num_rows, num_nodes), dtype=np.bool_)
    start = 0
    for each in graphs:
        rows, num_robots = slice(start, start + len(each.node)), each.node.shape[1]
        node[rows, :num_robots] = each.node
        parent[rows, :num_robots] = each.parent
        may_address[rows, :num_robots] = each.may_address
        start = rows.stop
    has_turn = np.concatenate([each.has_turn for each in graphs])[:, None]
    return {"node": node, "parent": parent, "may_address": may_address, "has_turn": has_turn}
