"""dm_control's interface: one mission as a `control.Environment`, with its cameras and its viewer.

The swarm flies the mission; dm_control is shown where the robots are. Changes of its physics are
seen in a picture, and are overwritten at the next window.
"""

from collections import OrderedDict
from collections.abc import Sequence
from importlib import metadata
from typing import Any

import numpy as np
from dm_control import mujoco
from dm_control.mujoco import wrapper
from dm_control.rl import control
from dm_env import specs
from jaxtyping import Int

from swarm_mj.control.motion import Controller
from swarm_mj.mission import Mission
from swarm_mj.physics.robots import OwnPilot
from swarm_mj.physics.scene import Scene, compose
from swarm_mj.protocol.checks import as_array, checked_robots
from swarm_mj.radio.free_space import OwnChannel
from swarm_mj.simulation.swarm import Swarm

_Task: Any = control.Task  # untyped: pyright reads its abstract methods as returning None


def make_environment(
    mission: Mission,
    seed: int = 0,
    *,
    channel: OwnChannel | None = None,
    controller: Controller | None = None,
    scene: Scene | None = None,
    pilot: OwnPilot | None = None,
) -> control.Environment:
    """Return one mission as an environment of dm_control, and so of dm_env.

    A step is a window, an episode is a mission.

    Args:
        mission: The mission.
        seed: Of the first mission, an integer of 0 or more; the next one has `seed + 1`, and so on.
        channel: As of `Swarm`: who decodes whom; None is the mission's own.
        controller: As of `Swarm`: what drives the robots; None is the task's own.
        scene: As of `Swarm`: a function that edits the MuJoCo model; None leaves the mission's
            arena as it is.
        pilot: As of `Swarm`: what makes the controls of bodies; None is the robot's own.

    Returns:
        The environment. An action is the recipient of each robot, [N] integers from 0 to N - 1,
        itself for silence; the reward is minus the age of information after the window [windows].

    Raises:
        ValueError: As `Swarm` does: if the seed is out of range, or if no connected team could be
            drawn or the scene changed the robots.
        TypeError: As `Swarm` does: for what is no mission, or cannot be called.
        RuntimeError: If dm_control does not work with this MuJoCo; the message says what does.

    Example:
        >>> time_step = make_environment(paper("flocking"), seed=1).reset()
    """
    swarm = Swarm(mission, [seed], channel=channel, controller=controller, scene=scene, pilot=pilot)
    return control.Environment(SwarmPhysics(swarm, seed), SwarmTask(seed))


class SwarmPhysics(mujoco.Physics):
    """A swarm of one mission, as dm_control's `named`, cameras and viewer know a physics.

    Its qpos and qvel are p and v (IV-A), or those of bodies. A copy of it is a still, to be looked
    at only.
    """

    def __init__(self, swarm: Swarm, seed: int) -> None:
        model = compose(swarm.mission, scene=swarm.scene).compile()
        try:
            super().__init__(wrapper.MjData(wrapper.MjModel(model)))
        except AttributeError as error:  # dm_control knows by name what a model has
            raise RuntimeError(
                f"dm_control {metadata.version('dm-control')} does not work with MuJoCo "
                f"{metadata.version('mujoco')} ({error}); pip install 'swarm_mj[dm-control]' "
                "chooses one that it works with"
            ) from error
        self.swarm = swarm
        self.restart(seed)

    def restart(self, seed: int) -> None:
        """Start a mission with this seed; until `recipient` is set, all are silent."""
        self._seed = seed
        self.swarm.restart([seed])
        self.recipient: Int[np.ndarray, "B N"] = self.swarm.views.silence.copy()
        self._show()

    def reset(self, keyframe_id: int | None = None) -> None:
        """Start the same mission anew, as dm_control asks before every episode."""
        super().reset(keyframe_id)
        self.restart(self._seed)

    def step(self, nstep: int = 1) -> None:
        """Fly windows of Alg. 1 with the recipients in `recipient`."""
        for _ in range(nstep):
            self.costs = self.swarm.step_with_recipients(self.recipient)
        self._show()

    def timestep(self) -> float:
        """Return the length of a window, however many steps MuJoCo takes for it [s]."""
        return self.swarm.mission.window_s

    def _show(self) -> None:
        mission = self.swarm.mission
        states = self.swarm.states
        self.data.time = self.swarm.now[0] * mission.window_s
        qpos, qvel = self.swarm.pose
        self.data.qpos[:] = qpos[0]
        self.data.qvel[:] = qvel[0]
        self.data.ctrl[:] = states.velocity_mps.ravel() if mission.physics == "exact" else 0.0
        self.forward()


class SwarmTask(_Task):
    """Choose everyone's recipient, so that the robots' information on each other is young."""

    def __init__(self, seed: int) -> None:
        self._next_seed = seed

    def initialize_episode(self, physics: SwarmPhysics) -> None:
        """Start a fresh mission with the next seed."""
        physics.restart(self._next_seed)
        self._next_seed += 1

    def before_step(self, action: np.ndarray | Sequence[int], physics: SwarmPhysics) -> None:
        """Set each robot's recipient, itself for silence; raise ValueError for other actions."""
        shape = (1, physics.swarm.mission.num_robots)
        recipient = as_array("recipient", action)[np.newaxis]
        physics.recipient = checked_robots("recipient", recipient, shape).copy()

    def action_spec(self, physics: SwarmPhysics) -> specs.BoundedArray:
        """Return the recipient of each robot, shape (N,), from 0 to N - 1."""
        num_robots = physics.swarm.mission.num_robots
        return specs.BoundedArray((num_robots,), np.int64, 0, num_robots - 1, name="recipient")

    def get_observation(self, physics: SwarmPhysics) -> OrderedDict[str, np.ndarray | np.float64]:
        """Return the buffers (II-B), [i, j]: what i knows about j; and the time [windows]."""
        buffers = vars(physics.swarm.buffers)
        known: dict[str, np.ndarray] = {}
        for name, array in buffers.items():
            if array.ndim > 1:
                known[name] = array[0].copy()
        return OrderedDict(known, now=physics.swarm.now[0])

    def get_reward(self, physics: SwarmPhysics) -> float:
        """Return minus the age of information after the window [windows]."""
        return -float(physics.costs.age_windows[0])

    def get_termination(self, physics: SwarmPhysics) -> float | None:
        """Return a discount of 1 after the last window: a mission is cut off, it reaches no end."""
        return 1.0 if physics.swarm.now[0] >= physics.swarm.mission.num_windows else None
