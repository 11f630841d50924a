"""Missions side by side for training: batches that end at different times, of several team sizes.

A batch is one swarm: its missions have one team size and begin and end together. Batches are
staggered, so that every rollout holds windows from all parts of a mission.
"""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.envs.credit import as_it_is, credits_of
from swarm_mj.mission import Mission
from swarm_mj.mission.components import Components
from swarm_mj.policies.gnn.feature_sets import make_extractor
from swarm_mj.policies.gnn.graphs import Graphs, check_width
from swarm_mj.protocol.costs import WindowCosts
from swarm_mj.simulation.swarm import Swarm

Reward = Literal["aoi", "velocity-variance"]  # the cost whose negative a team is paid
# Training and environments draw seeds from here on, so that small ones are never seen.
FIRST_TRAINING_SEED, LAST_TRAINING_SEED = 2**40, 2**62


@dataclass(kw_only=True)
class ActionHistory:
    """How a batch came to where it is: replayed, it leads to the same state."""

    seeds: list[int]  # of the missions under way
    last_window: int  # when they end [windows]
    recipients: list[Int[np.ndarray, "B N"]] = field(default_factory=list)  # window by window


@dataclass(frozen=True, kw_only=True)
class Transition:
    """What one window of a batch brought."""

    credit: Float[np.ndarray, "B N"]  # ages removed by each robot [windows]; 0 unless asked for
    costs: WindowCosts
    graphs: Graphs  # what the robots see next; of new missions if these ended
    last_graphs: Graphs | None  # what they saw at the end, if the missions ended here
    is_cut: bool  # whether they ended before the mission did, to stagger the batches


class MissionBatch:
    """Missions of one team size that begin and end together; the first ones are cut off."""

    def __init__(
        self,
        mission: Mission,
        features: str,
        num_missions: int,
        rng: np.random.Generator,
        *,
        first_windows: int,
        components: Components = Components(),
    ) -> None:
        """Start the first missions, of so many windows; `rng` draws the missions' seeds."""
        self.mission = mission
        self.num_missions = num_missions
        self._rng = rng
        self._features = features
        self._extractor = make_extractor(features, mission)
        self.num_features = len(self._extractor.names)  # F
        seeds = self._draw_seeds()
        self._swarm = Swarm(mission, seeds, **components.given)
        self._begin(ActionHistory(seeds=seeds, last_window=first_windows))

    def step(self, recipient: Int[np.ndarray, "B N"], *, with_credit: bool) -> Transition:
        """One window; missions that end start anew."""
        swarm, mission = self._swarm, self.mission
        before, now = swarm.buffers.timestamp.copy(), swarm.now
        channel = as_it_is(swarm.channel) if with_credit else swarm.channel
        costs = swarm.exchange(recipient)
        credit = np.zeros(recipient.shape)
        if with_credit:
            states = swarm.states
            credit = credits_of(
                before, states.position_m, recipient, channel, now, states.is_active
            )
        self.history.recipients.append(recipient.astype(np.int16))
        graphs = self._see()
        last_graphs = None
        is_cut = False
        if swarm.now[0] >= self.history.last_window:
            is_cut = self.history.last_window < mission.num_windows
            last_graphs = graphs
            graphs = self._begin(
                ActionHistory(seeds=self._draw_seeds(), last_window=mission.num_windows)
            )
        return Transition(
            credit=credit, costs=costs, graphs=graphs, last_graphs=last_graphs, is_cut=is_cut
        )

    def restart(self) -> Graphs:
        """Goes to the start of the missions under way; returns what the robots see there."""
        return self._begin(replace(self.history, recipients=[]))

    def replay(self, history: ActionHistory) -> Graphs:
        """Goes to the end of a history; returns what the robots see there."""
        graphs = self._begin(copy.deepcopy(history))
        for recipient in history.recipients:
            self._swarm.exchange(recipient.astype(np.int64))
            graphs = self._see()
        return graphs

    def _see(self) -> Graphs:
        """What the robots see; one that was switched off may only be silent."""
        graphs, is_active = self._extractor.graphs(self._swarm.views), self._swarm.states.is_active
        if is_active is None:
            return graphs
        own = np.tile(np.eye(self.mission.num_robots, dtype=np.bool_), (self.num_missions, 1))
        return replace(graphs, may_address=graphs.may_address & (is_active.reshape(-1, 1) | own))

    def _begin(self, history: ActionHistory) -> Graphs:
        """What the robots see at the start of a history's missions."""
        self.history = history
        self._swarm.restart(history.seeds)
        self._extractor.start(self.num_missions, self.mission.num_robots)
        graphs = self._see()
        check_width(self._features, self._extractor, graphs)
        return graphs

    def _draw_seeds(self) -> list[int]:
        size = self.num_missions
        return self._rng.integers(FIRST_TRAINING_SEED, LAST_TRAINING_SEED, size=size).tolist()


def make_batches(
    mission: Mission,
    team_sizes: Sequence[int],
    features: str,
    num_missions: int,
    num_batches: int,
    rng: np.random.Generator,
    components: Components = Components(),
) -> list[MissionBatch]:
    """Batches whose first missions are cut at different windows; team sizes take turns.

    So many missions in all are shared out evenly; `rng` draws their seeds.

    Raises:
        ValueError: The missions cannot be shared out evenly, or a size would have no batch.
    """
    if num_missions % num_batches or not 1 <= len(team_sizes) <= num_batches <= num_missions:
        raise ValueError(
            f"missions must be a multiple of their {num_batches} batches, of which each of the "
            f"{len(team_sizes)} team sizes needs one, not {num_missions}"
        )
    return [
        MissionBatch(
            replace(mission, num_robots=team_sizes[place % len(team_sizes)]),
            features,
            num_missions // num_batches,
            rng,
            first_windows=max(1, mission.num_windows * (place + 1) // num_batches),
            components=components,
        )
        for place in range(num_batches)
    ]
