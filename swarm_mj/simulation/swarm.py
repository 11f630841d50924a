"""The swarm: B missions side by side, window by window: motion, physics, radio, buffers, costs."""

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import replace
from functools import partial
from numbers import Integral

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.control.motion import Controller, controller_of, costed, initial_velocity
from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Started, check_seeds, streams_of
from swarm_mj.mission.placement import draw_survivors
from swarm_mj.physics.bodies import BodyWorlds
from swarm_mj.physics.robots import OwnPilot
from swarm_mj.physics.scene import Scene
from swarm_mj.physics.state import RobotStates
from swarm_mj.physics.worlds import PointWorlds, Worlds
from swarm_mj.policies.carrier_sense import SensingPolicy
from swarm_mj.policies.policy import CentralisedPolicy, DecentralisedPolicy, Policy, packet_by
from swarm_mj.protocol.buffers import Buffers, empty_buffers, grant_start, observe_self
from swarm_mj.protocol.checks import checked_robots
from swarm_mj.protocol.costs import TaskCost, WindowCosts, window_costs
from swarm_mj.protocol.packets import fitting, packet_of
from swarm_mj.protocol.partial_buffers import with_room
from swarm_mj.protocol.talk import talk_over
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.protocol.window import LocalViews, Phase
from swarm_mj.protocol.window_protocols import RequestResponse, WindowProtocol
from swarm_mj.radio.carrier_sensing import CarrierSensing, Contention
from swarm_mj.radio.free_space import OwnChannel
from swarm_mj.radio.mission_radio import mission_radio
from swarm_mj.simulation.components import Components
from swarm_mj.simulation.localisation import Localisation
from swarm_mj.simulation.starts import Starts
from swarm_mj.system.arguments import check_kind
from swarm_mj.system.user_code import is_ours

MAX_THREADS = 1024


def physics_of(
    mission: Mission,
    num_missions: int,
    *,
    scene: Scene | None,
    pilot: OwnPilot | None,
    num_threads: int,
) -> Worlds:
    """Return the worlds of a mission's robots, be they points or bodies."""
    if mission.has_bodies:
        return BodyWorlds(mission, num_missions, scene=scene, pilot=pilot, num_threads=num_threads)
    return PointWorlds(mission, num_missions, scene=scene, num_threads=num_threads)


class Swarm:
    """B missions that differ in their seed only: robots, radio and buffers, window by window.

    A mission's course depends on its own seed, not on the missions next to it. In each window the
    policy decides, the robots move, and then they talk.

    Args:
        mission: The numbers that all missions share.
        seeds: One integer of 0 or more for each mission.
        channel: Who decodes whom, as an object or `module:Name`; None is the mission's own.
        controller: What drives the robots; None is the task's own.
        scene: A function that edits the MuJoCo model, the same in all missions; None leaves the
            mission's arena as it is.
        pilot: What makes the controls of robots with bodies, as an object or `module:Name`; None is
            the robot's own.
        num_threads: Threads of MuJoCo, from 1 to 1024.

    Attributes:
        mission: The numbers that all missions share.
        scene: The function that edited the MuJoCo model; None: none did.
        channel: Who decodes whom.
        belief: The channel as robots believe it to be, before fades.
        truth: The channel as a centre knows it, before fades.
        controller: What drives the robots.
        is_broadcast: Whether the last window's packets were for everyone (IV-C).
        states: Where the robots truly are, [B N D] each, and who is active; D is 3 of bodies.
        buffers: What the robots know; entry `[b, i, j]` is what i knows about j.
        views: The same as robots see it: read only, with the clock and the last packets.
        now: t on the synchronised clock, [B], [windows].
        phases: Whom each robot addressed and decoded, in each slot of the last window.
        talk: How the robots talk over the channel: what `talk_over` chose.

    Raises:
        ValueError: Without seeds, for a number of threads out of range, or if no connected team
            could be drawn or the scene changed the robots.
        TypeError: For what is no mission, or cannot be called.

    Example:
        >>> swarm = Swarm(paper("flocking"), [1, 2])
        >>> swarm.start(make_policy("tdma", swarm.mission))
        >>> costs = swarm.step()
        >>> costs.age_windows.shape
        (2,)
    """

    def __init__(
        self,
        mission: Mission,
        seeds: Sequence[int],
        *,
        channel: OwnChannel | None = None,
        controller: str | Controller | None = None,
        scene: str | Scene | None = None,
        pilot: OwnPilot | None = None,
        num_threads: int = 1,
    ) -> None:
        """Place the robots and start all missions, each from its own seed."""
        check_kind("mission", mission, Mission, 'paper("flocking")')
        own = Components(channel=channel, controller=controller, scene=scene, pilot=pilot).made(
            mission
        )
        check_seeds(seeds)
        if not isinstance(num_threads, Integral) or not 1 <= num_threads <= MAX_THREADS:
            limits = f"from 1 to {MAX_THREADS}"
            raise ValueError(f"num_threads must be a whole number {limits}, not {num_threads!r}")
        self.mission = mission
        self.scene = own.scene
        self._num_missions = len(seeds)
        self._physics = physics_of(
            mission, len(seeds), scene=own.scene, pilot=own.pilot, num_threads=num_threads
        )

        # The channel that packets take, and what robots and a centre know of it.
        radio = mission_radio(mission, self._physics.obstacles, own.channel)
        self.channel = radio.channel
        self.belief = radio.belief
        self.truth = radio.truth
        self._sensing = CarrierSensing(mission, radio.truth)

        self.controller: Controller = (
            controller_of(mission) if own.controller is None else own.controller
        )
        self._controller_is_ours = is_ours(self.controller)
        self._costed = costed(self.controller)
        self.restart(seeds)

    def restart(self, seeds: Sequence[int]) -> None:
        """Start all missions anew, as many as before; a policy must then be started, too.

        Args:
            seeds: One integer of 0 or more for each mission.

        Raises:
            ValueError: If there are not as many seeds as before, or if no connected team could be
                drawn.
        """
        check_seeds(seeds, self._num_missions)
        self._rngs = streams_of(seeds)
        self._start_components()
        self._place_robots()
        self._start_clock()
        self._empty_buffers()
        self._policy: CentralisedPolicy | DecentralisedPolicy | None = None

    def _start_components(self) -> None:
        """Let the controller and the channel forget earlier missions, if they remember any."""
        # Before the robots are placed, as a channel is asked which teams it connects.
        num_robots = self.mission.num_robots
        if isinstance(self.controller, Started):
            self.controller.start(num_robots, self._rngs.motion)
        if isinstance(self.channel, Started):
            self.channel.start(num_robots, self._rngs.channel)
        self._sensing.start(num_robots, self._rngs.sensing)

    def _place_robots(self) -> None:
        """Draw where the robots begin, how fast, who will fail, and errors of localisation."""
        mission = self.mission
        rngs = self._rngs
        starts = Starts(mission, self._physics, self.truth.channel)
        position_m = [starts.positions(b, rng) for b, rng in enumerate(rngs.placement)]
        velocity_mps = [initial_velocity(mission, rng) for rng in rngs.placement]
        self._physics.start(rngs.bodies, rngs.pilots)
        self._physics.place(np.stack(position_m), np.stack(velocity_mps))
        self._survivors = draw_survivors(mission, rngs.failures)
        self._noise = None
        if mission.position_noise_m > 0.0:
            self._noise = Localisation(mission, rngs.localisation)

    def _start_clock(self) -> None:
        """Set the clock to the start, when nobody has said anything yet."""
        self.now = np.zeros(self._num_missions)  # t [windows]
        self.phases: tuple[Phase, ...] = ()
        self.is_broadcast = False

    def _empty_buffers(self) -> None:
        """Let the robots know themselves, and, where that is granted, each other's first states."""
        mission = self.mission
        self.buffers: Buffers = empty_buffers(
            self._num_missions, mission.num_robots, mission.num_axes
        )
        self._give_room(fitting(packet_of(mission), mission, "T, M and P").num_entries)
        self._read_only = self.buffers.read_only()
        states = self._observed(self.states)
        observe_self(self.buffers, states, self.now)
        if mission.grants("start"):
            grant_start(self.buffers, states)

    def _give_room(self, num_entries: int) -> None:
        """Let packets hold this many entries at most, and choose how robots talk by that."""
        self.buffers = with_room(self.buffers, num_entries)
        self.talk = talk_over(self.channel, self.buffers)

    @property
    def states(self) -> RobotStates:
        """Where the robots truly are, and who is active."""
        return self._physics.states

    @property
    def pose(self) -> tuple[Float[np.ndarray, "B Q"], Float[np.ndarray, "B V"]]:
        """MuJoCo's coordinates of the robots, and their rates, for viewers."""
        return self._physics.pose

    @property
    def views(self) -> LocalViews:
        """The robots' own views: all that they know."""
        return LocalViews(buffers=self._read_only, now=self.now, phases=self.phases)

    @property
    def policy(self) -> CentralisedPolicy | DecentralisedPolicy:
        """The policy that flies; raises ValueError before one was started."""
        self._check_started()
        assert self._policy is not None
        return self._policy

    def _check_started(self) -> None:
        """Raise ValueError before a policy was started."""
        if self._policy is None:
            raise ValueError("no policy flies yet; start one: swarm.start(policy)")

    def start(self, policy: Policy) -> None:
        """Fly a policy from now on, in place of the one that flew.

        Robots, buffers and clock stay as they are, and the policy draws where the missions' random
        streams are by now; `restart` begins missions anew.

        Args:
            policy: Made for this mission, as by `make_policy`.

        Raises:
            ValueError: If its packets never fit into a slot.
            TypeError: If it is no policy.
        """
        packet = packet_by(policy, self.mission)
        # A policy's type says what it may know: a centre the truth, robots what they believe.
        if isinstance(policy, CentralisedPolicy):
            policy.inform(self.truth)
        elif isinstance(policy, DecentralisedPolicy):
            policy.inform(self.belief)
        else:
            raise TypeError("a policy must be a DecentralisedPolicy or a CentralisedPolicy")
        if isinstance(policy, SensingPolicy):
            policy.listen(self._sense)
        policy.start(self.mission.num_robots, self._rngs.policy)
        self._give_room(packet.num_entries)
        self._policy = policy
        self._window = policy.window(self.mission)
        self._policy_is_ours = is_ours(policy)

    def decide(self) -> Int[np.ndarray, "B N"]:
        """Return whom each robot addresses next, by the policy that was started.

        It moves no robot and sends no packet. `step` checks the answer; here it is the policy's as
        it is.

        Returns:
            Recipients, [B N]: from 0 to N - 1, itself for silence, or `BROADCAST`.

        Raises:
            ValueError: If no policy was started.
        """
        policy = self.policy
        is_trusted = self._policy_is_ours
        views = self.views if is_trusted else self.views.copy()
        if isinstance(policy, CentralisedPolicy):
            return policy.recipients(views, self._states_for(is_trusted))
        return policy.recipients(views)

    def _sense(self, contention: Contention) -> Bool[np.ndarray, "B N"]:
        """Return who finds the channel idle, and so transmits."""
        return self._sensing.transmit(contention, self.states)

    def move(self) -> RobotStates:
        """Move the robots through one window, by their controller and the physics.

        The clock and the buffers stay as they are: those are for `step`, which calls this.

        Returns:
            The states afterwards: positions [m] and velocities [m/s], [B N D] each, who is active,
            and, where localisation errs, the positions that robots observe of themselves.

        Raises:
            ValueError: If the controller's accelerations are not one finite vector per robot, [B N
                D].
        """
        states = self._states_for(self._controller_is_ours)
        if self._noise is not None:
            states = replace(states, observed_m=self._noise.own_m(states))
        wanted_mps2 = self.controller(self._read_only, states)
        states = self._physics.step(np.asarray(wanted_mps2, dtype=np.float64))
        return self._observed(states)

    def _observed(self, states: RobotStates) -> RobotStates:
        """Return the states with what robots observe of themselves, a window after the last."""
        return states if self._noise is None else self._noise.advance(states)

    def step(self, policy: Policy | None = None) -> WindowCosts:
        """Fly one window: the policy decides, the robots move, then they talk.

        Args:
            policy: If it is new to these missions, it is started; None is the one that was started.

        Returns:
            What the window cost, in every mission.

        Raises:
            ValueError: If no policy was started, or one decided on what is no robot; and as
                `start` does.
            TypeError: As `start` does.
        """
        if policy is not None and policy is not self._policy:
            self.start(policy)
        self._check_started()
        return self._play(self._window, self.decide)

    def step_with_recipients(self, recipient: Int[np.ndarray, "B N"]) -> WindowCosts:
        """Fly one window of Alg. 1 with these recipients.

        Args:
            recipient: Whom each robot addresses, [B N], from 0 to N - 1; itself is silence.

        Returns:
            What the window cost, in every mission.

        Raises:
            ValueError: Unless they are one robot per robot; then nothing has moved.
        """
        request_response = RequestResponse(silence_is_attempt=self.mission.silence_is_attempt)
        return self._play(request_response, lambda: recipient)

    def _states_for(self, is_trusted: bool) -> RobotStates:
        """Return the true states; a user's own component gets copies, so it can move nothing."""
        return self.states if is_trusted else deepcopy(self.states)

    def _play(
        self, window: WindowProtocol, decide: Callable[[], Int[np.ndarray, "B N"]]
    ) -> WindowCosts:
        """Fly one window of this protocol: what fails, decisions, motion, packets, costs."""
        start = self.now
        self.is_broadcast = window.is_broadcast
        decide_after = partial(self._decide_after, decide, start)
        if self._survivors is not None and start[0] == self.mission.failure_window:
            self._physics.deactivate(self._survivors)
        self.phases = window(self.buffers, decide_after, self.move, self.talk, start)
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
    ) -> Int[np.ndarray, "B N"]:
        """Return the recipients in the slot after these."""
        if phases:  # a later slot is decided by its own clock, and knows the earlier one
            self.phases = phases
            self.now = start + len(phases) * SLOT_WINDOWS
        return checked_robots(
            "recipient", decide(), self.buffers.shape, may_broadcast=self.is_broadcast
        )

    def task_cost(self) -> TaskCost | None:
        """Return what the task costs now, where the controller has a cost.

        Returns:
            The cost's name and unit, and its value in each mission, [B]; None if there is none.

        Raises:
            ValueError: If the controller's cost is not one number of 0 or more for each mission.
        """
        controller = self._costed
        if controller is None:
            return None
        states = self._states_for(self._controller_is_ours)
        value = np.asarray(controller.cost(states), dtype=np.float64)
        if value.shape != self.now.shape or not (value >= 0.0).all():
            raise ValueError(
                f"a controller's cost must have shape {self.now.shape}, one number of 0 or more "
                f"for each mission, not {np.array2string(value, threshold=8)}"
            )
        return TaskCost(name=controller.cost_name, unit=controller.cost_unit, value=value)
