"""Missions as other libraries play them: what robots see, what a window pays, and where it ends.

All faces but dm_control's are made of this, so the same seeds and actions are the same missions
through each of them.
"""

import copy
from collections.abc import Sequence
from dataclasses import replace
from numbers import Integral
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.control.controller import Controller, Costed
from swarm_mj.control.motion import controller_of
from swarm_mj.envs.credit import as_it_is, credits_of
from swarm_mj.envs.mission_batch import FIRST_TRAINING_SEED, LAST_TRAINING_SEED
from swarm_mj.envs.options import check_features_named, check_fields, check_task
from swarm_mj.mission import PRESETS, Mission
from swarm_mj.mission.components import Components
from swarm_mj.physics.scene import Scene
from swarm_mj.policies.gnn.feature_sets import is_own_set, load_features, make_extractor
from swarm_mj.policies.gnn.graphs import check_width
from swarm_mj.protocol.costs import WindowCosts, age_of_information, velocity_variance
from swarm_mj.protocol.packets import check_whole
from swarm_mj.radio.free_space import Channel
from swarm_mj.simulation.swarm import Swarm

REWARDS = ("aoi", "velocity-variance", "task-cost", "credit")
Observation = dict[str, np.ndarray]
Info = dict[str, Any]

COSTS = {
    "aoi": "age_windows",
    "velocity-variance": "velocity_variance_m2ps2",
    "task-cost": "task_cost",
}  # what a team's reward is minus of, by its name in infos
TOLD = ("sent", "delivered", "lost", "overheard", "answered")  # counts of packets, in infos


class Team:
    """B missions that begin and end together, as environments show them.

    Index order: `[b, i]` is robot `i` of mission `b`.
    """

    def __init__(
        self,
        mission: Mission | str = "flocking",
        num_missions: int = 1,
        *,
        preset: str | None = None,
        features: str = "extended",
        reward: str = "aoi",
        with_parents: bool = False,
        channel: Channel | str | None = None,
        controller: Controller | str | None = None,
        scene: Scene | str | None = None,
        **fields: Any,
    ) -> None:
        """Take what to play; `restart` begins.

        Args:
            mission: The mission, or its task.
            num_missions: B.
            preset: Of a task's mission: "paper", which None is, or any other of `PRESETS`.
            features: What robots see of each teammate: the name of a feature set, or
                `module:Name` of your own.
            reward: "aoi", minus the age of information [windows]; "velocity-variance", minus the
                variance of Eq. 17 [m²/s²]; "task-cost", minus what the task costs, by its
                controller, in its unit; or "credit", each robot's own: by how much the team's
                age would be higher had it been silent in this window [windows].
            with_parents: Whether robots see the parents P as well, for graph networks.
            channel: As of `Swarm`, or its name, `module:Name`. A copy of it is used, and so of the
                next two.
            controller: As of `Swarm`.
            scene: As of `Swarm`.
            **fields: Any other field of `Mission`.

        Raises:
            ValueError: A value is unknown or out of range, or does not go with another.
            TypeError: A field is not one of `Mission`'s, the features are no name, or a part cannot
                be called.
        """
        check_count("num_missions", num_missions)
        self.mission = _mission_of(mission, preset, fields)
        self.num_missions = num_missions
        components = Components(channel=channel, controller=controller, scene=scene)
        # Copies, as those that draw or remember do so for us only.
        self._components = copy.deepcopy(components.made(self.mission))
        self.reward = _checked(reward, self.mission, self._components.controller)
        self.with_parents = with_parents
        check_features_named(features)
        if is_own_set(features):
            load_features(features)
        self.features = features
        self._extractor = make_extractor(features, self.mission)
        self.num_features = len(self._extractor.names)  # F
        self.swarm: Swarm | None = None  # made when it begins

    def restart(self, seeds: Sequence[int]) -> None:
        """Begins the missions of these seeds.

        Raises:
            ValueError: There are not B seeds, one is negative, or a team cannot be connected.
        """
        if self.swarm is None:
            self.swarm = Swarm(self.mission, seeds, **self._components.given)
        else:
            self.swarm.restart(seeds)
        self.seeds = list(seeds)
        self._extractor.start(self.num_missions, self.mission.num_robots)
        self._see()
        self._keep_start()

    def step(self, recipient: Int[np.ndarray, "B N"]) -> Float[np.ndarray, "B N"]:
        """One window of Alg. 1, in which each robot addresses a recipient; itself is silence.

        Returns:
            What each robot is paid; all of a team alike, unless the reward is credit.

        Raises:
            ValueError: No mission has begun, they are over, or a recipient is no robot; nothing has
                moved.
        """
        swarm = self.flown
        if self.is_over:
            raise ValueError(
                f"the mission is over after its {self.mission.num_windows} windows; call reset()"
            )
        before, start = swarm.buffers.timestamp.copy(), swarm.now
        channel = as_it_is(swarm.channel) if self.reward == "credit" else swarm.channel
        costs = swarm.exchange(recipient)
        self._see()
        self._keep_costs(costs)
        if self.reward == "credit":
            states = swarm.states
            own = credits_of(before, states.position_m, recipient, channel, start, states.is_active)
            return own / self.mission.num_robots**2
        cost = self._costs[COSTS[self.reward]]
        return np.broadcast_to(-cost[:, None], recipient.shape)

    @property
    def flown(self) -> Swarm:
        """The swarm that flies the missions; raises ValueError before they have begun."""
        if self.swarm is None:
            raise ValueError("no mission has begun; call reset() first")
        return self.swarm

    @property
    def is_over(self) -> bool:
        """Whether the last window has been flown."""
        return bool(self.flown.now[0] >= self.mission.num_windows)

    @property
    def is_active(self) -> Bool[np.ndarray, "B N"]:
        """Which robots have not been switched off."""
        is_active = self.flown.states.is_active
        shape = (self.num_missions, self.mission.num_robots)
        return np.ones(shape, dtype=np.bool_) if is_active is None else is_active

    def infos(self) -> Info:
        """Return the missions' seeds, and what the last window cost, by name, [B] each.

        Names and numbers are those of `swarm-mj fly --json`. Before the first window, when nothing
        is known and nothing was sent, ages and packets are 0.
        """
        return {"seed": np.array(self.seeds), **self._costs}

    def _keep_start(self) -> None:
        """Keep what a window that has not been flown would cost."""
        swarm = self.flown
        controller = swarm.controller
        task = (
            {"task_cost": controller.cost(swarm.states)} if isinstance(controller, Costed) else {}
        )
        age_windows, is_complete = age_of_information(swarm.buffers, swarm.now)
        self._costs: Info = {
            "age_windows": age_windows,
            "velocity_variance_m2ps2": velocity_variance(swarm.states.velocity_mps),
            "is_complete": is_complete,
            **{f"packets_{name}": np.zeros(self.num_missions) for name in TOLD},
            **task,
        }

    def _keep_costs(self, costs: WindowCosts) -> None:
        self._costs = {
            "age_windows": costs.age_windows,
            "velocity_variance_m2ps2": costs.velocity_variance_m2ps2,
            "is_complete": costs.is_complete,
            **{f"packets_{name}": getattr(costs.packets, name) for name in TOLD},
            **({"task_cost": costs.task_cost.value} if costs.task_cost else {}),
        }

    def _see(self) -> None:
        """Keep what the robots see now in `observation`, new arrays of shape [B, N, ...].

        A robot that was switched off may only be silent.
        """
        graphs = self._extractor.graphs(self.flown.views)
        check_width(self.features, self._extractor, graphs)
        shape = (self.num_missions, self.mission.num_robots, self.mission.num_robots)
        may_address = graphs.may_address.reshape(shape) & self.is_active[:, :, None]
        may_address |= np.eye(self.mission.num_robots, dtype=np.bool_)
        self.observation: Observation = {
            "action_mask": may_address.astype(np.int8),
            "observation": graphs.node.reshape(*shape, self.num_features),
        }
        if self.with_parents:
            self.observation["parent"] = graphs.parent.reshape(shape).copy()


def next_seed(rng: np.random.Generator) -> int:
    """The seed of a mission for which none was given; like training's, none of an evaluation's."""
    return int(rng.integers(FIRST_TRAINING_SEED, LAST_TRAINING_SEED))


def check_count(what: str, number: object) -> None:
    """Raise ValueError unless a number of missions, or of environments, is one."""
    if not isinstance(number, Integral) or number < 1:
        raise ValueError(f"{what} must be 1 or more, not {number!r}")


def _mission_of(mission: Mission | str, preset: str | None, fields: dict[str, Any]) -> Mission:
    """Return a mission as it is, or a task's, with other values of some fields."""
    check_task(mission)
    check_fields(mission, fields)
    if isinstance(mission, Mission):
        if preset not in (None, mission.preset):
            raise ValueError(
                f"preset {preset} goes with a task's name, and this mission is given whole, from "
                f"the preset {mission.preset}; leave it out"
            )
        return replace(mission, **fields)
    preset = "paper" if preset is None else preset
    task = replace(Mission(), preset=preset, task=mission).task  # refuses what is unknown
    return PRESETS[preset](task, **fields)


def _checked(reward: str, mission: Mission, controller: Controller | None) -> str:
    """Return the reward, if there is such a one for these missions; raises ValueError otherwise."""
    if reward not in REWARDS:
        raise ValueError(f"reward must be one of {', '.join(REWARDS)}, not {reward!r}")
    if reward == "task-cost" and not isinstance(controller or controller_of(mission), Costed):
        raise ValueError(
            f"reward task-cost needs a task that has a cost, and {mission.task} has none; choose "
            "another task, or reward aoi"
        )
    if reward == "credit" and mission.failure_fraction > 0.0:
        raise ValueError(
            "reward credit needs robots that do not fail, but failure_fraction is "
            f"{mission.failure_fraction:g}; set it to 0, or choose reward aoi"
        )
    if reward == "credit":
        check_whole("reward credit", mission)
    return reward
