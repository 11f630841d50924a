"""The swarm: B missions side by side, window by window: motion, physics, radio, buffers, costs."""

from collections.abc import Callable, Sequence
from copy import deepcopy
from functools import partial
from numbers import Integral

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.control.motion import Controller, controller_of, costed, initial_velocity
from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Started, check_seeds, streams_of
from swarm_mj.mission.placement import connected_positions, draw_survivors
from swarm_mj.physics.scene import Scene
from swarm_mj.physics.state import ROBOT_HEIGHT_M, ROBOT_RADIUS_M, RobotStates
from swarm_mj.physics.worlds import Physics
from swarm_mj.policies.policy import (
    CentralisedPolicy,
    DecentralisedPolicy,
    Policy,
    check_parameters,
)
from swarm_mj.protocol.buffers import Buffers, empty_buffers, grant_start, observe_self
from swarm_mj.protocol.checks import check_robots
from swarm_mj.protocol.costs import TaskCost, WindowCosts, window_costs
from swarm_mj.protocol.packets import Packet, fitting, packet_of, with_room
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.protocol.window import LocalViews, Phase, RequestResponse, WindowProtocol
from swarm_mj.radio.free_space import Channel, VaryingChannel
from swarm_mj.radio.mission_radio import mission_radio
from swarm_mj.radio.obstruction import blocked
from swarm_mj.simulation.components import Components
from swarm_mj.simulation.localisation import Localisation
from swarm_mj.system.fields import check_kind, name_of
from swarm_mj.system.user_code import is_ours

MAX_THREADS = 1024
MAX_DRAWN_AT_ONCE = 1000  # robots of a team that is drawn anew as a whole until it is connected


class Swarm:
    """B missions that differ in their seed only.

    A mission's course depends on its own seed, not on the missions next to it.
    """

    def __init__(
        self,
        mission: Mission,
        seeds: Sequence[int],
        *,
        channel: str | Channel | VaryingChannel | None = None,
        controller: str | Controller | None = None,
        scene: str | Scene | None = None,
        num_threads: int = 1,
    ) -> None:
        """Place the robots and start all missions, each from its own seed.

        Channel, controller and scene are objects or `module:Name`; unless given, they are the
        mission's own, and no obstacles are added. All missions share a scene. The threads are
        MuJoCo's. Raises ValueError without seeds, or if no connected team could be drawn or the
        scene changed the robots; TypeError for what is no mission, or cannot be called.
        """
        check_kind("mission", mission, Mission, 'paper("flocking")')
        own = Components(channel=channel, controller=controller, scene=scene).made(mission)
        check_seeds(seeds)
        if not isinstance(num_threads, Integral) or not 1 <= num_threads <= MAX_THREADS:
            limits = f"from 1 to {MAX_THREADS}"
            raise ValueError(f"num_threads must be a whole number {limits}, not {num_threads!r}")
        self.mission = mission
        self.scene = own.scene
        self._physics = Physics(mission, len(seeds), scene=own.scene, num_threads=num_threads)
        radio = mission_radio(mission, self._physics.obstacles, own.channel)
        self.channel, self.belief, self.truth = radio
        is_tasks = own.controller is None
        self.controller: Controller = controller_of(mission) if is_tasks else own.controller
        self._controller_is_ours = is_ours(self.controller)
        self._costed = costed(self.controller)
        self._num_missions = len(seeds)
        self.restart(seeds)

    def restart(self, seeds: Sequence[int]) -> None:
        """Start all missions anew, as many as before; a policy must then be started, too.

        Raises ValueError as the constructor does.
        """
        check_seeds(seeds, self._num_missions)
        self._rngs, mission = streams_of(seeds), self.mission
        # Before the robots are placed, as a channel is asked which teams it connects.
        if isinstance(self.controller, Started):
            self.controller.start(mission.num_robots, self._rngs.motion)
        if isinstance(self.channel, Started):
            self.channel.start(mission.num_robots, self._rngs.channel)
        position_m = [self._place(b, rng) for b, rng in enumerate(self._rngs.placement)]
        velocity_mps = [initial_velocity(mission, rng) for rng in self._rngs.placement]
        self._physics.place(np.stack(position_m), np.stack(velocity_mps))
        self._survivors = draw_survivors(mission, self._rngs.failures)
        self.now = np.zeros(len(seeds))  # t [windows]
        room = fitting(packet_of(mission), mission, "T, M and P").num_entries
        self.buffers: Buffers = with_room(empty_buffers(len(seeds), mission.num_robots), room)
        is_exact = mission.position_noise_m == 0.0
        self._noise = None if is_exact else Localisation(mission, self._rngs.localisation)
        states = self._noise.observed(self.states) if self._noise else self.states
        observe_self(self.buffers, states, self.now)
        if mission.grants("start"):
            grant_start(self.buffers, states)
        self.phases: tuple[Phase, ...] = ()
        self.is_broadcast = False  # whether the last window's packets were for everyone (IV-C)
        self._read_only = self.buffers.read_only()
        self._policy: CentralisedPolicy | DecentralisedPolicy | None = None

    def _place(self, b: int, rng: np.random.Generator) -> Float[np.ndarray, "N 2"]:
        """Draw where mission b's robots begin, connected under their channel where it can say."""
        mission, composed = self.mission, self.truth.channel
        has_obstacles = self._physics.obstacles is not None
        return connected_positions(
            num_robots=mission.num_robots,
            half_side_m=mission.half_side_m,
            range_m=mission.range_m,
            rng=rng,
            largest_part_at=partial(composed.largest_part, mission=b) if composed else None,
            is_blocked_at=self._is_blocked if has_obstacles or mission.collide else None,
            keeps_largest=has_obstacles or mission.num_robots > MAX_DRAWN_AT_ONCE,
        )

    def _is_blocked(self, position_m: Float[np.ndarray, "N 2"]) -> Bool[np.ndarray, "N"]:
        """Return which robots would touch an obstacle there, or another robot if they collide."""
        is_blocked = np.zeros(len(position_m), dtype=bool)
        if (obstacles := self._physics.obstacles) is not None:
            is_blocked = blocked(position_m, ROBOT_HEIGHT_M, ROBOT_RADIUS_M, obstacles)
        if self.mission.collide:
            apart_m = np.linalg.norm(position_m[:, np.newaxis] - position_m, axis=-1)
            overlaps = np.tril(apart_m < 2.0 * ROBOT_RADIUS_M, k=-1)  # the first one may stay
            is_blocked |= np.any(overlaps, axis=1)
        return is_blocked

    @property
    def states(self) -> RobotStates:
        """Where the robots truly are, and who is active."""
        return self._physics.states

    @property
    def views(self) -> LocalViews:
        """The robots' own views: all that they know."""
        return LocalViews(buffers=self._read_only, now=self.now, phases=self.phases)

    @property
    def policy(self) -> CentralisedPolicy | DecentralisedPolicy:
        """The policy that flies; raises ValueError before one was started."""
        if self._policy is None:
            raise ValueError("no policy flies yet; start one: swarm.start(policy)")
        return self._policy

    def start(self, policy: Policy) -> None:
        """Fly a policy from now on, with new random streams and all else forgotten.

        Raises ValueError if its packets never fit into a slot, and TypeError if it is no policy.
        """
        check_kind("policy", policy, Policy, 'make_policy("planner", mission)')
        check_parameters(policy)
        packet = policy.packet(self.mission)
        if not isinstance(packet, Packet):
            raise ValueError(
                f"packet() of {name_of(policy)} must return a Packet, not {packet!r:.80}"
            )
        # A policy's type says what it may know: a centre the truth, robots what they believe.
        if isinstance(policy, CentralisedPolicy):
            policy.inform(self.truth)
        elif isinstance(policy, DecentralisedPolicy):
            policy.inform(self.belief)
        else:
            raise TypeError("a policy must be a DecentralisedPolicy or a CentralisedPolicy")
        policy.start(self.mission.num_robots, self._rngs.policy)
        self.buffers = with_room(self.buffers, packet.num_entries)
        self._policy, self._window = policy, policy.window(self.mission)
        self._policy_is_ours = is_ours(policy)

    def decide(self) -> Int[np.ndarray, "B N"]:
        """Return whom each robot addresses next, by the policy that was started."""
        policy, is_trusted = self.policy, self._policy_is_ours
        views = self.views if is_trusted else self.views.copy()
        if isinstance(policy, CentralisedPolicy):
            return policy.recipients(views, self._states_for(is_trusted))
        return policy.recipients(views)

    def move(self) -> RobotStates:
        """Move the robots through one window, by their controller and the physics."""
        wanted_mps2 = self.controller(self._read_only, self._states_for(self._controller_is_ours))
        states = self._physics.step(np.asarray(wanted_mps2, dtype=np.float64))
        return states if self._noise is None else self._noise.observed(states)

    def step(self, policy: Policy | None = None) -> WindowCosts:
        """Fly one window: the policy decides, the robots move, then they talk.

        A policy that is new to these missions is started; None is the one that was started.
        Raises as `start` does, and ValueError if none was started.
        """
        if policy is not None and policy is not self._policy:
            self.start(policy)
        _ = self.policy  # raises if none was started
        return self._play(self._window, self.decide)

    def step_with_recipients(self, recipient: Int[np.ndarray, "B N"]) -> WindowCosts:
        """Fly one window of Alg. 1 with these recipients; itself is silence.

        Raises ValueError, before anything moves, unless they are one robot per robot.
        """
        request_response = RequestResponse(silence_is_attempt=self.mission.silence_is_attempt)
        return self._play(request_response, lambda: recipient)

    def _states_for(self, is_trusted: bool) -> RobotStates:
        """Return the true states; a user's own component gets copies, so it can move nothing."""
        return self.states if is_trusted else deepcopy(self.states)

    def _play(
        self, window: WindowProtocol, decide: Callable[[], Int[np.ndarray, "B N"]]
    ) -> WindowCosts:
        """Fly one window of this protocol."""
        start, self.is_broadcast = self.now, window.is_broadcast
        decide_after = partial(self._decide_after, decide, start)
        if self._survivors is not None and start[0] == self.mission.failure_window:
            self._physics.deactivate(self._survivors)
        self.phases = window(self.buffers, decide_after, self.move, self.channel, start)
        self.now = start + 1.0
        return window_costs(
            self.buffers,
            self.states,
            self.phases,
            self.now,
            is_broadcast=window.is_broadcast,
            task_cost=self.task_cost(),
        )

    # Not within `_play`: tests, which check types, would wrap it anew in every window.
    def _decide_after(
        self,
        decide: Callable[[], Int[np.ndarray, "B N"]],
        start: Float[np.ndarray, "B"],
        phases: tuple[Phase, ...],
    ) -> np.ndarray:
        """Return the recipients in the slot after these."""
        if phases:  # a later slot is decided by its own clock, and knows the earlier one
            self.phases, self.now = phases, start + len(phases) * SLOT_WINDOWS
        recipient = np.asarray(decide())
        check_robots("recipient", recipient, self.buffers.shape, may_broadcast=self.is_broadcast)
        return recipient

    def task_cost(self) -> TaskCost | None:
        """Return what the task costs now, where the controller has a cost."""
        controller = self._costed
        if controller is None:
            return None
        states = self._states_for(self._controller_is_ours)
        value = np.asarray(controller.cost(states), dtype=np.float64)
        if value.shape != self.now.shape or not np.all(value >= 0.0):
            raise ValueError(
                f"a controller's cost must have shape {self.now.shape}, one number of 0 or more "
                f"for each mission, not {np.array2string(value, threshold=8)}"
            )
        return TaskCost(name=controller.cost_name, unit=controller.cost_unit, value=value)
