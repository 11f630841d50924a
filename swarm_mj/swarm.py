"""The swarm: B missions side by side, window by window: motion, physics, radio, buffers, costs."""

from collections.abc import Sequence
from numbers import Integral

import numpy as np
from jaxtyping import Bool, Int

from swarm_mj.control.motion import initial_velocity, motion_of
from swarm_mj.mission import Mission
from swarm_mj.mission.placement import connected_positions
from swarm_mj.mission.robot_failures import draw_is_on, first_window_without
from swarm_mj.physics.state import RobotStates
from swarm_mj.physics.worlds import Physics
from swarm_mj.policies.policy import CentralisedPolicy, DecentralisedPolicy, Policy
from swarm_mj.protocol.buffers import Buffers, check_robots, empty_buffers, observe_self
from swarm_mj.protocol.costs import WindowCosts, window_costs
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.protocol.window import PHASE, Phase, transmit, window
from swarm_mj.radio.free_space import Channel
from swarm_mj.radio.mission_radio import radio_of

MAX_SEED = 2**63 - 1  # the largest that a replay's properties keep


class Swarm:
    """B missions that differ in their seed only.

    A mission's course depends on its own seed, not on the missions beside it.
    """

    def __init__(
        self,
        mission: Mission,
        seeds: Sequence[int],
        *,
        channel: Channel | None = None,
        num_threads: int = 1,
    ) -> None:
        """Places the robots and starts all missions.

        Args:
            mission: The numbers of every mission.
            seeds: One per mission; its length is B.
            channel: Who decodes whom; the mission's `FreeSpaceRadio` unless given.
            num_threads: MuJoCo's own.

        Raises:
            ValueError: No seed, a negative one, or no connected team could be drawn.
        """
        _check_seeds(seeds)
        self.mission = mission
        self.channel = radio_of(mission) if channel is None else channel
        self._physics = Physics(mission, len(seeds), num_threads=num_threads)
        self._num_missions = len(seeds)
        self.restart(seeds)

    def restart(self, seeds: Sequence[int]) -> None:
        """Starts all missions anew.

        Args:
            seeds: One per mission, as many as before.

        Raises:
            ValueError: Not as many seeds, a negative one, or no connected team could be drawn.
        """
        _check_seeds(seeds, self._num_missions)
        placement, motion, policy, outage = zip(*(_streams(seed) for seed in seeds), strict=True)
        mission = self.mission
        position_m = [
            connected_positions(mission.num_robots, mission.half_side_m, mission.range_m, rng)
            for rng in placement
        ]
        velocity_mps = [initial_velocity(mission, rng) for rng in placement]
        self._physics.place(np.stack(position_m), np.stack(velocity_mps))
        self._motion = motion_of(mission, motion)
        self._policy_rngs = policy
        self._stays_on = draw_is_on(mission, outage)
        self.is_on: Bool[np.ndarray, "B N"] | None = None  # in the last window; None: everyone
        self.now = np.zeros(len(seeds))  # t [windows]
        self.buffers: Buffers = empty_buffers(len(seeds), mission.num_robots)
        observe_self(self.buffers, self.bodies.position_m, self.bodies.velocity_mps, self.now)
        self.phases: tuple[Phase, ...] = ()
        self._read_only = self.buffers.read_only()
        self._started: Policy | None = None

    @property
    def bodies(self) -> RobotStates:
        """Where the robots truly are."""
        return self._physics.bodies

    @property
    def views(self) -> LocalViews:
        """What every robot knows."""
        return LocalViews(buffers=self._read_only, now=self.now, phases=self.phases)

    def start(self, policy: Policy) -> None:
        """Gives a policy the missions' random streams and lets it forget earlier missions."""
        policy.start(self.mission.num_robots, self._policy_rngs)
        self._started = policy

    def decide(self, policy: Policy) -> Int[np.ndarray, "B N"]:
        """Whom each robot addresses next, from no more than the policy's type allows it to know.

        A policy that is new to these missions is started first.

        Raises:
            TypeError: The policy is neither decentralised nor centralised.
        """
        if policy is not self._started:
            self.start(policy)
        if isinstance(policy, CentralisedPolicy):
            return policy.recipients(self.views, self.bodies)
        if isinstance(policy, DecentralisedPolicy):
            return policy.recipients(self.views)
        raise TypeError("a policy must be a DecentralisedPolicy or a CentralisedPolicy")

    def move(self) -> None:
        """Moves the robots through one window, by their motion and the physics."""
        self._physics.step(self._motion(self.buffers, self.bodies))

    def step(self, policy: Policy) -> WindowCosts:
        """One window: the policy decides, the robots move, then they talk."""
        if policy.transmits_twice:
            return self._flood(policy)
        return self.exchange(self.decide(policy))

    def exchange(self, recipient: Int[np.ndarray, "B N"]) -> WindowCosts:
        """One window of Alg. 1 with these recipients, after the robots have moved.

        Args:
            recipient: Whom each robot addresses; itself is silence.

        Returns:
            What the window cost.

        Raises:
            ValueError: A recipient is no robot, or there is not one per robot; nothing has moved.
        """
        check_robots("recipient", recipient, self.buffers.shape)
        self._switch_off()
        self.move()
        phases = window(
            self.buffers,
            self.bodies,
            recipient,
            self.channel,
            self.now,
            silence_is_attempt=self.mission.silence_is_attempt,
            is_on=self.is_on,
        )
        self.phases = phases
        self.now = self.now + 2 * PHASE
        return self._costs(phases, has_response=True)

    def _flood(self, policy: Policy) -> WindowCosts:
        """One window of two transmissions, each decided on what was known before it (IV-C)."""
        self._switch_off()
        phases: list[Phase] = []
        moves_twice = policy.moves_each_transmission and self.mission.moves_each_transmission
        for half in (1, 2):
            recipient = self.decide(policy)
            check_robots("recipient", recipient, self.buffers.shape)
            if half == 1 or moves_twice:
                self.move()
            self.now = self.now + PHASE
            phase = transmit(
                self.buffers,
                self.bodies,
                recipient,
                self.channel,
                self.now,
                silence_is_attempt=self.mission.silence_is_attempt,
                is_on=self.is_on,
            )
            phases.append(phase)
            self.phases = tuple(phases)
        return self._costs((phases[0], phases[1]), has_response=False)

    def _costs(self, phases: tuple[Phase, Phase], *, has_response: bool) -> WindowCosts:
        return window_costs(
            self.buffers,
            self.bodies,
            phases,
            self.now,
            has_response=has_response,
            is_on=self.is_on,
        )

    def _switch_off(self) -> None:
        """Before a window: switches off, half-way, whoever is to be."""
        if self.now[0] >= first_window_without(self.mission):
            self.is_on = self._stays_on


def _check_seeds(seeds: Sequence[int], expected: int | None = None) -> None:
    """Raises ValueError unless there are seeds, as many as expected, and none is negative."""
    is_whole = all(isinstance(seed, Integral) and 0 <= seed <= MAX_SEED for seed in seeds)
    if not is_whole or len(seeds) != (expected or max(1, len(seeds))):
        count = "one or more" if expected is None else str(expected)
        raise ValueError(f"seeds must be {count} integers from 0 to {MAX_SEED}, not {list(seeds)}")


def _streams(seed: int) -> list[np.random.Generator]:
    """Placement, motion, policy and outages draw apart, so policies meet equal missions."""
    return [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(4)]
