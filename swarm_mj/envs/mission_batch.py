"""Missions side by side, as environments and training fly them: views, rewards, infos.

All interfaces but dm_control's consist of it, so the same seeds and actions are the same missions
through each of them.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.envs.credit import (
    Credits,
    End,
    ReplayedWindow,
    credits_over,
    replay_otherwise,
    snapshot_channel,
)
from swarm_mj.mission import Mission
from swarm_mj.physics.robots import kinds_of, sensor_limits
from swarm_mj.policies.gnn.feature_sets import make_extractor
from swarm_mj.policies.gnn.graphs import Graphs, check_width
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.checks import checked_robots
from swarm_mj.protocol.costs import WindowCosts, age_of_information, velocity_variance
from swarm_mj.protocol.mission_costs import (
    AOI,
    BY_REWARD,
    TASK_COST,
    VELOCITY_VARIANCE,
    Reward,
)
from swarm_mj.protocol.packet_counts import no_packets
from swarm_mj.simulation.components import Components
from swarm_mj.simulation.swarm import Swarm

Observation = dict[str, np.ndarray]
Info = dict[str, Any]

# A team's reward is minus a cost. "credit" is each robot's own.
AgentReward: TypeAlias = Literal[Reward, "credit"]
REWARDS: tuple[AgentReward, ...] = get_args(AgentReward)
# Training and environments draw seeds from here on, so small ones are left for evaluations.
FIRST_TRAINING_SEED = 2**40
LAST_TRAINING_SEED = 2**62
NOT_BEGUN = "no mission has begun; call reset() first"


class MissionBatch:
    """B missions of one team size that begin and end together; `[b, i]` is robot i of mission b."""

    def __init__(
        self,
        mission: Mission,
        num_missions: int = 1,
        *,
        features: str = "extended",
        reward: AgentReward = "aoi",
        with_parents: bool = False,
        with_sensors: bool = False,
        components: Components = Components(),
        keeps_recipients: bool = False,
        unknown_age: float = 0.0,
    ) -> None:
        """Take arguments as of `make_batch`.

        Args:
            mission: As there, as are those down to `components`.
            num_missions: B.
            features: As there.
            reward: As there.
            with_parents: As there.
            with_sensors: As there; raises ValueError for robots without sensors.
            components: Parts that are not the mission's own: see `Components`.
            keeps_recipients: Whether decisions are kept, so that checkpoints can fly it again.
            unknown_age: How much older than the mission a teammate never heard of counts in
                credits [windows].
        """
        self.mission = mission
        self.num_missions = num_missions
        self.shape = (num_missions, mission.num_robots)  # B N
        self.features = features
        self.reward: AgentReward = reward
        self.with_parents = with_parents
        self.with_sensors = with_sensors
        self.sensor_limits = _sensor_limits(mission) if with_sensors else np.zeros(0)  # S
        self.swarm: Swarm | None = None  # made when it begins
        self._graphs: Graphs | None = None  # likewise
        self.components = components
        self._keeps_recipients = keeps_recipients
        self._unknown_age = unknown_age
        self._extractor = make_extractor(features, mission)
        self.num_features = len(self._extractor.names)  # F

    def restart(self, seeds: Sequence[int], last_window: int | None = None) -> None:
        """Begin the missions of B seeds, to be cut off after `last_window` if that is given."""
        if self.swarm is None:
            self.swarm = Swarm(self.mission, seeds, **self.components.given)
        else:
            self.swarm.restart(seeds)
        self.seeds = list(seeds)
        self.last_window = last_window or self.mission.num_windows
        # Of the last window. Before the first nothing is known and nothing was sent.
        age_windows, is_complete = age_of_information(self.swarm.buffers, self.swarm.now)
        self.costs = WindowCosts(
            age_windows=age_windows,
            is_complete=is_complete,
            velocity_variance_m2ps2=velocity_variance(self.swarm.states.velocity_mps),
            counts=no_packets(self.num_missions),
            task_cost=self.swarm.task_cost(),
        )
        self.recipients: list[np.ndarray] = []  # of the windows flown, if they are kept
        self._extractor.start(self.num_missions, self.mission.num_robots)
        self._see()
        check_width(self.features, self._extractor, self.graphs)

    def step(self, recipient: Int[np.ndarray, "B N"]) -> Float[np.ndarray, "B N"]:
        """Fly one window of Alg. 1, in which each robot addresses a recipient; itself is silence.

        Args:
            recipient: Whom each robot addresses, [B N], from 0 to N - 1.

        Returns:
            The reward of each robot, [B N]: minus the cost that `reward` names, in its unit, the
            same for a whole team; or, for "credit", the age that its own packets saved, a mean over
            pairs of robots [windows].

        Raises:
            ValueError: If no mission has begun, they are over, or a recipient is no robot; then
                nothing has moved.
        """
        recipient = checked_robots("recipient", recipient, self.shape)
        if self.reward == "credit":
            return self.mean_credits([self.fly_for_credit(recipient)], horizon=1).credit[0]
        cost = BY_REWARD[self.reward].of_window(self.fly(recipient))
        if cost is None:
            raise ValueError(f"reward {self.reward} needs a task that has a cost")
        return np.broadcast_to(-cost[:, None], recipient.shape)

    def fly_for_credit(
        self,
        recipient: Int[np.ndarray, "B N"],
        considered: Int[np.ndarray, "B N"] | None = None,
    ) -> ReplayedWindow:
        """Fly a window as `step` does, and replay it as it might have been.

        Args:
            recipient: Whom each robot addresses, [B N], from 0 to N - 1.
            considered: Whom it might have addressed, where it is silent; see `replay_otherwise`.

        Returns:
            What `mean_credits` takes.

        Raises:
            ValueError: As `step` does.
        """
        swarm = self.flown
        # The window is replayed, which takes T and the channel's draws from before it.
        before = swarm.buffers.timestamp.copy()
        # The first news of a teammate lowers the age by the few windows flown, and a robot that
        # waits for more loses nothing: so it may count for more.
        before[~swarm.buffers.is_known] = NEVER - self._unknown_age
        start = swarm.now
        channel = snapshot_channel(swarm.channel)
        self.fly(recipient)
        return replay_otherwise(
            before,
            swarm.states.position_m,
            recipient,
            channel,
            now=start,
            is_active=swarm.states.is_active,
            considered=considered,
            end=self._end,
        )

    def mean_credits(self, windows: Sequence[ReplayedWindow], horizon: int) -> Credits:
        """Return robots' credits as `credits_over` does, but as means over pairs [windows]."""
        found = credits_over(windows, horizon)
        return found._replace(credit=found.credit / self.mission.num_robots**2)  # sizes count alike

    def fly(self, recipient: Int[np.ndarray, "B N"]) -> WindowCosts:
        """Fly a window as `step` does, without computing rewards.

        Args:
            recipient: Whom each robot addresses, [B N], from 0 to N - 1; itself is silence.

        Returns:
            What the window cost, in every mission; `costs` keeps it, too.

        Raises:
            ValueError: As `step` does.
        """
        if self.is_over:
            raise ValueError(
                f"the mission is over after its {self.last_window} windows; call reset()"
            )
        self.costs = self.flown.step_with_recipients(recipient)
        if self._keeps_recipients:
            self.recipients.append(recipient.astype(np.int16))
        self._see()
        return self.costs

    def _see(self) -> None:
        """Keep the robots' present graphs; a robot that has failed may only be silent."""
        graphs = self._extractor.graphs(self.flown.views)
        if self.flown.states.is_active is not None:
            own = np.tile(np.eye(self.mission.num_robots, dtype=np.bool_), (self.num_missions, 1))
            may_address = graphs.may_address & (self.is_active.reshape(-1, 1) | own)
            graphs = replace(graphs, may_address=may_address)
        self._graphs = graphs

    @property
    def flown(self) -> Swarm:
        """The swarm that flies the missions; raises ValueError before they have begun."""
        if self.swarm is None:
            raise ValueError(NOT_BEGUN)
        return self.swarm

    @property
    def graphs(self) -> Graphs:
        """The graphs that robots now see; raises ValueError before the missions have begun."""
        if self._graphs is None:
            raise ValueError(NOT_BEGUN)
        return self._graphs

    @property
    def is_over(self) -> bool:
        """True after the last window."""
        return bool(self.flown.now[0] >= self.last_window)

    @property
    def _end(self) -> End | None:
        """How missions end now, if they do."""
        if not self.is_over:
            return None
        return "cut" if self.last_window < self.mission.num_windows else "over"

    @property
    def is_active(self) -> Bool[np.ndarray, "B N"]:
        """Robots that have not failed."""
        is_active = self.flown.states.is_active
        return np.ones(self.shape, dtype=np.bool_) if is_active is None else is_active

    @property
    def observation(self) -> Observation:
        """The robots' present view, new arrays of shape [B, N, ...]; see `options.robot_spaces`."""
        num_robots = self.mission.num_robots
        shape = (*self.shape, num_robots)
        # Silence is always allowed: a user's own features may forget it, and samplers need one way.
        may_address = self.graphs.may_address.reshape(shape) | np.eye(num_robots, dtype=np.bool_)
        seen = {
            "action_mask": may_address.view(np.int8),
            "observation": self.graphs.node.reshape(*shape, self.num_features),
        }
        if self.with_parents:  # a copy: graphs may share P with the swarm, which writes it in place
            seen["parent"] = self.graphs.parent.reshape(shape).copy()
        if self.with_sensors:
            sensors = self.flown.states.sensors
            assert sensors is not None  # as there are limits of them
            seen["sensors"] = sensors.astype(np.float32)
        return seen

    def infos(self) -> Info:
        """Return the missions' seeds and the last window's costs, by name, [B] each.

        Names and numbers are those of `swarm-mj fly --json`. Before the first window, when nothing
        is known and nothing was sent, ages and packets are 0.
        """
        costs = self.costs
        packets = costs.packets
        infos: Info = {
            "seed": np.array(self.seeds),
            AOI.info: costs.age_windows,
            VELOCITY_VARIANCE.info: costs.velocity_variance_m2ps2,
            "is_complete": costs.is_complete,
            "packets_sent": packets.sent,
            "packets_delivered": packets.delivered,
            "packets_lost": packets.lost,
            "packets_overheard": packets.overheard,
            "packets_answered": packets.answered,
        }
        if costs.task_cost is not None:
            infos[TASK_COST.info] = costs.task_cost.value
        return infos

    def first(self) -> tuple[Observation, Info]:
        """Return the first mission's view and infos, for environments of a single mission."""
        info = {name: values[0].item() for name, values in self.infos().items()}
        return {name: values[0] for name, values in self.observation.items()}, info


def _sensor_limits(mission: Mission) -> Float[np.ndarray, "S"]:
    """Return how large robots' sensor numbers can be; raise ValueError if there are none."""
    limits = sensor_limits(kinds_of(mission)) if mission.has_bodies else np.zeros(0)
    if limits.size == 0:
        raise ValueError(
            f"with_sensors needs robots with sensors, and robot {mission.robot} has none; choose "
            "an MJCF file with sensors, or with_sensors=False"
        )
    return limits


def seeds_from(first: int | None, number: int) -> list[int | None]:
    """Return seeds that count on from the first, kept as it is; None: missions are drawn."""
    if first is None:
        return [None] * number
    return [first, *(first + n for n in range(1, number))]


def seed_or_next(seed: int | None, rng: np.random.Generator) -> int:
    """Return the seed; if it is None, draw another mission's, which no evaluation has."""
    return int(rng.integers(FIRST_TRAINING_SEED, LAST_TRAINING_SEED)) if seed is None else seed
