"""Policies, whose type is what they may know: local views (Eq. 9), or the truth."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission import Mission
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import BROADCAST
from swarm_mj.protocol.packets import Packet, PacketField, fitting, packet_of
from swarm_mj.protocol.window import DoubleBroadcast, LocalViews, RequestResponse, WindowProtocol
from swarm_mj.radio.mission_radio import Belief, TrueLinks

Parameters = Mapping[str, bool | int | float | str]  # what a policy was made with, by name


class Policy:
    """A choice of the robot that every robot addresses next, and of the form of a window."""

    is_centralised: bool = False  # whether a centre decides, or each robot by itself
    uses: str = ""  # the information that it decides by, in a few words; ours: `uses.toml`
    payload: str = "none"  # what packets carry beyond T, M and P (II-B), in a word

    def window(self, mission: Mission) -> WindowProtocol:
        """Return what the robots do in a window: by Alg. 1 they request, and respond."""
        return RequestResponse(silence_is_attempt=mission.silence_is_attempt)

    def payload_fields(self, mission: Mission) -> tuple[PacketField, ...]:  # noqa: ARG002
        """Return what packets carry beyond T, M and P; the mission says how wide fields must be."""
        return ()

    def packet(self, mission: Mission) -> Packet:
        """Return the packet, with all entries that a slot holds; ValueError if it holds none."""
        packet = packet_of(mission, self.payload_fields(mission))
        return fitting(packet, mission, type(self).__name__)

    @property
    def parameters(self) -> Parameters:
        """Numbers that the policy was made with, by name; results keep them."""
        return {}

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Prepare for new missions: N robots in each, and one generator per mission."""


def check_parameters(policy: Policy) -> None:
    """Raise ValueError for a parameter that a file of results could not hold."""
    for name, value in policy.parameters.items():
        if value is not None and type(value) not in (bool, int, float, str):
            raise ValueError(
                f"parameter {name} of {type(policy).__name__} must be a plain number, a text, True "
                f"or False, not {value!r:.80} of the type {type(value).__name__}; convert it"
            )


class DecentralisedPolicy(Policy, ABC):
    """A policy that every robot evaluates on its own view (Eq. 9)."""

    def inform(self, belief: Belief) -> None:
        """Receive, before `start`, what all robots know of the channel."""
        self._belief = belief

    @abstractmethod
    def recipients(self, views: LocalViews) -> Int[np.ndarray, "B N"]:
        """Return the robot that each robot addresses; itself is silence.

        Row [b, i] may depend on view [b, i] only.
        """


class BroadcastPolicy(DecentralisedPolicy):
    """A decentralised policy whose packets are for everyone who hears them (IV-C)."""

    def window(self, mission: Mission) -> WindowProtocol:
        """Return what the robots do in a window: they broadcast twice, unanswered."""
        return DoubleBroadcast(
            silence_is_attempt=mission.silence_is_attempt,
            needs_addressees=mission.half_duplex == "eavesdroppers",
        )

    @abstractmethod
    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return who broadcasts in the next slot; [b, i] may depend on view [b, i] only."""

    def recipients(self, views: LocalViews) -> Int[np.ndarray, "B N"]:
        """Return `BROADCAST` for robots that transmit; ValueError if `transmits` is not bools."""
        transmits = np.asarray(self.transmits(views))
        shape = views.silence.shape
        if transmits.shape != shape or transmits.dtype != np.bool_:
            raise ValueError(
                f"transmits of {type(self).__name__} must be True or False for each robot, an "
                f"array of bool of shape {shape}, missions by robots, not {transmits.dtype} of "
                f"shape {transmits.shape}"
            )
        return np.where(transmits, BROADCAST, views.silence)


class TeamView(NamedTuple):
    """The views of one mission's robots, side by side: row i of every array is robot i's own."""

    now: float  # t on the synchronised clock [windows]
    is_known: Bool[np.ndarray, "N N"]  # whether i knows anything of j
    timestamp: Float[np.ndarray, "N N"]  # T^{i,j} [windows]
    position_m: Float[np.ndarray, "N N 2"]  # M^{i,j} [m]
    velocity_mps: Float[np.ndarray, "N N 2"]  # M^{i,j} [m/s]
    parent: Int[np.ndarray, "N N"]  # P^{i,j}
    heard: Int[np.ndarray, "N"]  # whom i decoded in the last slot; itself: nobody


def team_views(views: LocalViews) -> list[TeamView]:
    """Return the views mission by mission, for policies that remember each on its own."""
    now, buffers = views.now.tolist(), views.buffers
    heard = views.phases[-1].heard if views.phases else views.silence
    known = buffers.is_known, buffers.timestamp, buffers.position_m, buffers.velocity_mps
    return [TeamView(*its) for its in zip(now, *known, buffers.parent, heard, strict=True)]


class CentralisedPolicy(Policy, ABC):
    """A policy that knows the truth: everyone's buffer and everyone's true state."""

    is_centralised = True  # unless the truth stands in for what each robot senses

    def inform(self, truth: TrueLinks) -> None:
        """Receive, before `start`, the true links before their fades."""
        self._truth = truth

    @abstractmethod
    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """Return each robot's recipient, by all views and true states; itself is silence."""
