"""Training's missions: batches that end at different times, seen as graphs of the largest team.

Batches are staggered, so that every rollout holds windows from all parts of a mission.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from jaxtyping import Bool, Float, Int
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from swarm_mj.envs.credit import ReplayedWindow
from swarm_mj.envs.mission_batch import MissionBatch, Observation, seed_or_next
from swarm_mj.envs.vec_env import BatchVecEnv
from swarm_mj.learning.credit_scale import CreditScale
from swarm_mj.learning.settings import Training
from swarm_mj.policies.gnn.graphs import Graphs
from swarm_mj.policies.gnn.own_networks import empty_network
from swarm_mj.protocol.buffers import NO_PARENT


class RowCredits(NamedTuple):
    """The worth to its team of each of E robots' packet, sent or only considered, in S windows.

    Means over pairs [windows], divided by their kind's scale if credits are scaled.
    """

    credit: Float[np.ndarray, "S E"]
    is_whole: Bool[np.ndarray, "S E"]  # whether all of the horizon was flown, or the mission ended


class GraphVecEnv(BatchVecEnv):
    """Environments for PPO over the Aggregation GNN, per robot or per team by its credit.

    Per robot, the reward is the robot's credit over the number of pairs, divided by what is usual
    in its kind of mission if credits are scaled. Where packets are considered, the reward is 0, and
    `take_credits` returns the credits. Per team, it is the negative mean age of information over
    the mission's duration, or the negative velocity variance, as in Fig. 6.

    Smaller teams are padded: per team with robots that do not exist, which are silent and see
    nothing.

    Attributes:
        recalls: Asks what the network remembers since its last decision, [E *robots H]; None unless
            it has a memory.
        considered_recipient: Asks whom robots might have addressed in their last decision, [E], if
            those packets are to have credits as well; None if not.
    """

    recalls: Callable[[], np.ndarray] | None = None
    considered_recipient: Callable[[], np.ndarray] | None = None

    def __init__(self, training: Training, rng: np.random.Generator) -> None:
        """Begin missions, whose seeds `rng` draws; the first ones are cut off at different windows.

        Raises ValueError if they cannot be shared out evenly, or a kind would have no batch.
        """
        self.rng = rng
        self.agent = training.credit_assignment
        kinds = [n % len(training.kinds) for n in range(training.groups)]  # of batches: in turns
        self.batches = _make_batches(training, kinds)
        # Of each batch: its windows of late, whose credits have not been taken.
        self._windows: list[list[ReplayedWindow]] = [[] for _ in self.batches]
        # A scale for each kind of mission, which its batches share; none if credits are not scaled.
        num_scales = len(training.kinds) if training.credit_scaling == "kind" else 0
        self.credit_scales = [CreditScale() for _ in range(num_scales)]
        self._scales: list[CreditScale | None] = [None] * len(self.batches)  # of each batch
        if self.credit_scales:
            self._scales = [self.credit_scales[kind] for kind in kinds]
        self.num_nodes = training.most_robots  # of every graph
        if self.agent == "team" and training.reward == "aoi":
            self.reward_unit = float(training.mission.num_windows)
        self._least_windows = training.least_windows
        self._most_windows = training.most_windows
        for n, batch in enumerate(self.batches):
            last_window = self._draw_windows() * (n + 1) // len(self.batches)
            batch.restart(self._draw_seeds(batch), max(1, last_window))
        sizes: list[int] = []  # of each mission's team
        for batch in self.batches:
            sizes += [batch.shape[1]] * batch.num_missions
        owners = [np.arange(size, dtype=np.int32) for size in sizes]
        self._owner = np.concatenate(owners)[:, None]
        self._is_robot = np.arange(self.num_nodes) < np.array(sizes)[:, None]
        # What each robot remembers, row by row; None unless the network has a memory.
        self.memory: np.ndarray | None = None
        memory_size = 0
        if training.own_network:
            memory_size = empty_network(training.network, training.own_network).memory_size
        if memory_size:
            self.memory = np.zeros((sum(sizes), memory_size), np.float32)
        ends = np.cumsum([batch.num_missions * batch.shape[1] for batch in self.batches]).tolist()
        starts = [0, *ends[:-1]]
        self._rows = [slice(*each) for each in zip(starts, ends, strict=True)]  # of each batch
        seen = {name: self._space_of(rows) for name, rows in self._observe().items()}
        if self.agent == "robot":
            action = spaces.Discrete(self.num_nodes)
        else:
            action = spaces.MultiDiscrete([self.num_nodes] * self.num_nodes)
        super().__init__(self.batches, self.agent, spaces.Dict(seen), action)

    @property
    def num_teams(self) -> int:
        """Missions, and so team decisions a window."""
        return sum(batch.num_missions for batch in self.batches)

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Change nothing: the training's own generator draws the missions' seeds."""
        del seed
        return [None] * self.num_envs

    def reset(self) -> Observation:
        """Start the missions under way over; others would shift the seeds of all that follow."""
        for batch in self.batches:
            batch.restart(batch.seeds, batch.last_window)
        self._forget_windows()
        if self.memory is not None:
            self.memory[:] = 0.0
        return self._observe()

    def replay(
        self,
        seeds: Sequence[list[int]],
        last_windows: Sequence[int],
        recipients: Sequence[np.ndarray],  # [window, mission, robot]
    ) -> Observation:
        """Begin missions, batch by batch, and fly them as recorded; return what is seen then."""
        begun = zip(self.batches, seeds, last_windows, recipients, strict=True)
        for batch, batch_seeds, last_window, flown in begun:
            batch.restart(batch_seeds, last_window)
            for recipient in flown.astype(np.int64):
                batch.fly(recipient)
        self._forget_windows()
        return self._observe()

    def _forget_windows(self) -> None:
        for windows in self._windows:
            windows.clear()

    def step_wait(self) -> VecEnvStepReturn:
        """Fly one window; robots remember what they did when they decided on it."""
        if self.memory is not None and self.recalls is not None:
            remembered = self.recalls()
            self.memory[:] = remembered if self.agent == "robot" else remembered[self._is_robot]
        seen, reward, done, infos = super().step_wait()
        if self.considered_recipient is None:
            for scale, envs in zip(self._scales, self._envs, strict=True):
                if scale is not None:
                    reward[envs] = scale.divided(reward[envs])
        return seen, reward, done, infos

    def take_credits(self, horizon: int) -> RowCredits:
        """Return the credits of the windows flown since they were last taken.

        There are some where `considered_recipient` is asked.
        """
        num_windows = len(self._windows[0])
        credit = np.zeros((num_windows, self.num_envs), np.float32)
        is_whole = np.zeros(credit.shape, np.bool_)
        for batch, windows, envs in zip(self.batches, self._windows, self._envs, strict=True):
            found = batch.mean_credits(windows, horizon)
            credit[:, envs] = found.credit.reshape(num_windows, -1)
            is_whole[:, envs] = found.is_whole[:, None]
            windows.clear()
        for window in range(num_windows):  # outside: a scale forgets by windows, not by batches
            for scale, envs in zip(self._scales, self._envs, strict=True):
                # A part of a horizon, of which nothing is learned, would make the scale too small.
                if scale is not None and is_whole[window, envs.start]:
                    credit[window, envs] = scale.divided(credit[window, envs])
        return RowCredits(credit=credit, is_whole=is_whole)

    def _fly(self, n: int, recipient: Int[np.ndarray, "B N"]) -> Float[np.ndarray, "B N"]:
        if self.considered_recipient is None:
            return super()._fly(n, recipient)
        batch = self.batches[n]
        considered = self.considered_recipient()[self._envs[n]].reshape(batch.shape)
        self._windows[n].append(batch.fly_for_credit(recipient, considered))
        return np.zeros(batch.shape)

    def _begin(self, n: int) -> None:
        if self.memory is not None:
            self.memory[self._rows[n]] = 0.0
        last_window = self._draw_windows()
        self.batches[n].restart(self._draw_seeds(self.batches[n]), last_window)

    def _draw_windows(self) -> int:
        """Return after how many windows missions that now begin are cut off."""
        if self._least_windows == self._most_windows:
            return self._most_windows  # without a draw: seeds stay what they were
        return int(self.rng.integers(self._least_windows, self._most_windows + 1))

    def _draw_seeds(self, batch: MissionBatch) -> list[int]:
        # One generator for all batches: a checkpoint keeps its state alone.
        return [seed_or_next(None, self.rng) for _ in range(batch.num_missions)]

    def _is_truncated(self) -> Bool[np.ndarray, "E"]:
        # The value of missions cut off early goes on, that of ended ones is 0.
        is_cut = [batch.last_window < batch.mission.num_windows for batch in self.batches]
        return np.repeat(is_cut, [envs.stop - envs.start for envs in self._envs])

    def _infos(self) -> list[dict[str, Any]]:
        return [{} for _ in range(self.num_envs)]  # nothing reads them, and each takes its time

    def _observe(self) -> Observation:
        """Return the graphs of all robots, per team stacked with those of robots that are not."""
        rows_of = padded([batch.graphs for batch in self.batches], self.num_nodes)
        if self.memory is not None:
            rows_of["memory"] = self.memory.copy()
        if self.agent == "robot":
            return {**rows_of, "owner": self._owner}
        observation = {"is_robot": self._is_robot}
        for name, rows in rows_of.items():
            teams = np.zeros((*self._is_robot.shape, *rows.shape[1:]), dtype=rows.dtype)
            teams[self._is_robot] = rows
            observation[name] = teams
        observation["parent"][~self._is_robot] = NO_PARENT
        observation["may_address"] |= np.eye(self.num_nodes, dtype=np.bool_)
        return observation

    def _space_of(self, rows: np.ndarray) -> spaces.Space:
        if rows.dtype == np.bool_:
            return spaces.MultiBinary(rows.shape[1:])
        if rows.dtype == np.float32:
            return spaces.Box(-np.inf, np.inf, rows.shape[1:], np.float32)
        return spaces.Box(NO_PARENT, self.num_nodes - 1, rows.shape[1:], rows.dtype.type)


def env_of(model: PPO) -> GraphVecEnv:
    """Return a model's environment, inside any wrappers."""
    env = model.get_env()
    inner = env.unwrapped if env is not None else None
    assert isinstance(inner, GraphVecEnv)
    return inner


def padded(graphs: Sequence[Graphs], num_nodes: int) -> Observation:
    """Join all batches' graphs by name, with unconnected nodes that no robot may address.

    Their R rows have M = `num_nodes` nodes, at least as many as the batches'; `has_turn` is [R, 1].
    """
    ends = np.cumsum([len(each.parent) for each in graphs]).tolist()
    joined = {
        "node": np.zeros((ends[-1], num_nodes, graphs[0].node.shape[2]), np.float32),
        "parent": np.full((ends[-1], num_nodes), NO_PARENT, np.int32),
        "may_address": np.zeros((ends[-1], num_nodes), np.bool_),
    }
    for each, end in zip(graphs, ends, strict=True):
        for name, rows in joined.items():
            part = getattr(each, name)
            rows[end - len(part) : end, : part.shape[1]] = part
    return {**joined, "has_turn": np.concatenate([each.has_turn for each in graphs])[:, None]}


def _make_batches(training: Training, kinds: Sequence[int]) -> list[MissionBatch]:
    """Return batches of missions of these kinds, by number, which share out all evenly."""
    num_missions = training.missions
    num_batches = len(kinds)
    flown = training.kinds
    if num_missions % num_batches or not len(flown) <= num_batches <= num_missions:
        raise ValueError(
            f"missions must be a multiple of their {num_batches} batches, of which each of the "
            f"{len(flown)} kinds of missions needs one, not {num_missions}"
        )
    batches: list[MissionBatch] = []
    for kind in kinds:
        batch = MissionBatch(
            flown[kind],
            num_missions // num_batches,
            features=training.features,
            reward="credit" if training.credit_assignment == "robot" else training.reward,
            components=training.components,
            keeps_recipients=True,
            unknown_age=training.unknown_age,
        )
        batches.append(batch)
    return batches
