"""Options and spaces that all environments share: what users ask for, and what they get."""

import copy
from numbers import Integral
from typing import Any, NamedTuple, Unpack, get_args

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import batch_space
from jaxtyping import Float, Float32

from swarm_mj.control.motion import Controller, Costed, controller_of
from swarm_mj.envs import environment_id
from swarm_mj.envs.mission_batch import REWARDS, AgentReward, MissionBatch
from swarm_mj.mission import MISSION_DISTANCE_M, Mission, Task, TaskAndFields, make_mission
from swarm_mj.mission.geometry import PLANE
from swarm_mj.physics.arenas import arena_of
from swarm_mj.physics.robots import OwnPilot
from swarm_mj.physics.scene import Scene
from swarm_mj.policies.gnn.feature_sets import is_own_set, load_features
from swarm_mj.policies.gnn.graphs import REFERENCE_WINDOWS
from swarm_mj.policies.gnn.packet_memory import LONG_WINDOWS
from swarm_mj.protocol.buffers import NO_PARENT
from swarm_mj.protocol.packets import check_whole
from swarm_mj.radio.free_space import OwnChannel
from swarm_mj.simulation.components import Components
from swarm_mj.system.arguments import checked_choice


class RobotTruth(NamedTuple):
    """The numbers of each robot in `truth`, in this order; all is normalised, and has no unit."""

    position: Float[np.ndarray, "B N D"]  # by half the side of the area
    velocity: Float[np.ndarray, "B N D"]  # by the maximum
    is_active: Float[np.ndarray, "B N 1"]  # 1, or 0 once it has failed
    age: Float[np.ndarray, "B N N"]  # of what it knows of each robot: 0 is now; 1: never known


def num_truths(num_robots: int, num_axes: int = PLANE) -> int:
    """Return how many numbers `truth` has: the share that is flown, then those of `RobotTruth`."""
    position = velocity = num_axes
    is_active = 1
    return 1 + num_robots * (position + velocity + is_active + num_robots)


class BatchOptions(TaskAndFields, total=False):
    """Keywords of `make_batch`, which says what they mean, for functions that pass them on.

    They are written out for type checkers, as `MissionFields` is; a test holds them equal.
    """

    preset: str | None
    features: str
    reward: str
    with_parents: bool
    with_sensors: bool
    channel: OwnChannel | None
    controller: Controller | str | None
    scene: Scene | str | None
    pilot: OwnPilot | None


def make_batch(
    mission: Mission | str = "flocking",
    num_missions: int = 1,
    *,
    preset: str | None = None,
    features: str = "extended",
    reward: str = "aoi",
    with_parents: bool = False,
    with_sensors: bool = False,
    channel: OwnChannel | None = None,
    controller: Controller | str | None = None,
    scene: Scene | str | None = None,
    pilot: OwnPilot | None = None,
    **fields: Unpack[TaskAndFields],
) -> MissionBatch:
    """Return missions that have not begun, by the options that all environments share.

    Raises ValueError if a value is unknown or out of range, or does not go with another; TypeError
    if a field is not one of `Mission`'s, the features are no name, or a component is not callable.

    Args:
        mission: The mission, or its task.
        num_missions: B.
        preset: Of a task's mission: "paper", which None is, or any other of `PRESETS`.
        features: Features of each teammate: the name of a feature set, or `module:Name` of your
            own.
        reward: "aoi", minus the age of information [windows]; "velocity-variance", minus the
            velocity variance [m²/s²]; "task-cost", minus the controller's cost of the task, in its
            unit; or "credit", each robot's own: by how much the team's age would be higher had the
            robot been silent in this window [windows].
        with_parents: Whether robots see the parents P as well, for graph networks.
        with_sensors: Whether robots see the numbers of their own sensors, too; of robots with
            bodies whose models have sensors.
        channel: As of `Swarm`, or its name, `module:Name`; a copy of it is used.
        controller: Likewise.
        scene: Likewise.
        pilot: Likewise.
        **fields: Any other field of `Mission`.
    """
    if not isinstance(num_missions, Integral) or num_missions < 1:
        raise ValueError(f"the number of missions must be 1 or more, not {num_missions!r}")
    for task in get_args(Task):
        if mission == environment_id(task):
            raise ValueError(
                f"{mission!r} is a name for gymnasium.make; did you mean {task!r}, the task?"
            )
    if "seed" in fields:
        raise TypeError("seed is no option of an environment; give it to reset(seed=...)")
    mission = make_mission(mission, preset=preset, **fields)
    components = Components(channel=channel, controller=controller, scene=scene, pilot=pilot)
    # Copies: a component may draw or remember, and another environment may be given the same one.
    components = copy.deepcopy(components.made(mission))
    arena_of(mission)  # refuses one that is not there
    paid = _checked_reward(reward, mission, components.controller)
    if not isinstance(features, str):  # stored policies keep the name
        raise TypeError(f'features must be a name, such as "module:Name", not {features!r:.80}')
    if is_own_set(features):
        load_features(features)
    return MissionBatch(
        mission,
        num_missions,
        features=features,
        reward=paid,
        with_parents=with_parents,
        with_sensors=with_sensors,
        components=components,
    )


def make_team_batch(
    mission: Mission | str, num_missions: int = 1, **options: Unpack[BatchOptions]
) -> MissionBatch:
    """Return a `make_batch` where the agent is the team; refuse rewards of single robots."""
    batch = make_batch(mission, num_missions, **options)
    if batch.reward == "credit":
        raise ValueError(
            "reward credit is each robot's own, and this environment pays the team; choose reward "
            "aoi, or an environment whose agents are robots (swarm_mj.envs.pettingzoo)"
        )
    return batch


def _checked_reward(reward: str, mission: Mission, controller: Controller | None) -> AgentReward:
    """Return a reward that goes with a mission; raise ValueError for any other."""
    paid = checked_choice("reward", reward, REWARDS)
    if paid == "task-cost" and not isinstance(controller or controller_of(mission), Costed):
        raise ValueError(
            f"reward task-cost needs a task that has a cost, and {mission.task} has none; choose "
            "another task, or reward aoi"
        )
    if paid == "credit":
        check_whole("reward credit", mission)
        if mission.clocks_differ:
            raise ValueError(
                "reward credit replays windows one by one, which takes a common clock; choose "
                "another reward (credit team), or clock offset and drift 0"
            )
    return paid


def robot_spaces(batch: MissionBatch) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
    """Return one robot's observation space, and its recipients.

    `observation` [N, F] is what it knows of every teammate, itself included: see `FEATURES` of the
    feature set; all are normalised, and none has a unit. `action_mask` [N] is 1 for recipients
    within reach; itself, which is silence, always is. `parent` [N] is the robot that a
    teammate's news came over first, or -1. `sensors` [S] are the numbers of its sensors, in
    MuJoCo's units, each within its sensor's cutoff, if the model gives one.
    """
    num_robots = batch.mission.num_robots
    most = np.inf if is_own_set(batch.features) else largest_feature(batch.mission)
    seen: dict[str, spaces.Space] = {
        "action_mask": spaces.Box(0, 1, (num_robots,), np.int8),
        "observation": spaces.Box(-most, most, (num_robots, batch.num_features), np.float32),
    }
    if batch.with_parents:
        seen["parent"] = spaces.Box(NO_PARENT, num_robots - 1, (num_robots,), np.int32)
    if batch.with_sensors:
        limits = batch.sensor_limits.astype(np.float32)
        seen["sensors"] = spaces.Box(-limits, limits, dtype=np.float32)
    return spaces.Dict(seen), spaces.Discrete(num_robots)


def team_spaces(batch: MissionBatch) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
    """Return all robots' observation space, with a leading axis N, and everyone's recipients."""
    num_robots = batch.mission.num_robots
    seen, _ = robot_spaces(batch)
    return batch_space(seen, num_robots), spaces.MultiDiscrete([num_robots] * num_robots)


def largest_feature(mission: Mission) -> float:
    """Return a bound on every number that a feature set makes of a mission.

    Ages are shares of the mission or of `REFERENCE_WINDOWS`; positions and distances are those of
    robots that fly straight on all the time, by the area or by 1 km; counts are by 10 at least.
    """
    flown_m = mission.max_velocity_mps * mission.window_s * mission.num_windows
    lengths = (mission.side_m + 2.0 * flown_m) / min(mission.side_m, MISSION_DISTANCE_M)
    return float(np.ceil(mission.num_robots + mission.num_windows / REFERENCE_WINDOWS + lengths))


def truth_space(mission: Mission) -> spaces.Box:
    """Return the space of `truth`: all numbers are normalised, and none has a unit."""
    num_robots = mission.num_robots
    most = largest_feature(mission)
    return spaces.Box(-most, most, (num_truths(num_robots, mission.num_axes),), np.float32)


def truth(batch: MissionBatch) -> Float32[np.ndarray, "B S"]:
    """Return where all robots truly are, and how old everything is that each of them knows.

    It is for critics that see it in training; no robot ever does.

    The share of the mission that is flown; then for every robot its position by half the side of
    the area, its velocity by the maximum, 1 if it is active, and the age of what it knows of each
    robot, on the scale of the extended features.
    """
    mission = batch.mission
    swarm = batch.flown
    age = np.minimum(swarm.now[:, np.newaxis, np.newaxis] - swarm.buffers.timestamp, LONG_WINDOWS)
    log_age = np.log1p(age) / np.log1p(LONG_WINDOWS)  # 0 is now, 1 is `LONG_WINDOWS` ago
    robots = RobotTruth(
        position=swarm.states.position_m / mission.half_side_m,
        velocity=swarm.states.velocity_mps / (mission.max_velocity_mps or 1.0),
        is_active=batch.is_active[..., np.newaxis].astype(np.float64),
        age=np.where(swarm.buffers.is_known, log_age, 1.0),
    )
    flown = swarm.now[:, np.newaxis] / mission.num_windows
    by_robot = np.concatenate(robots, axis=-1)
    return np.hstack([flown, by_robot.reshape(len(flown), -1)]).astype(np.float32)
