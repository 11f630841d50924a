"""Policies, whose type is what they may know: local views, or the truth."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission import Mission
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.about import NO_PAYLOAD, About
from swarm_mj.protocol.buffers import BROADCAST
from swarm_mj.protocol.packets import Packet, PacketField, fitting, packet_of
from swarm_mj.protocol.window import LocalViews
from swarm_mj.protocol.window_protocols import DoubleBroadcast, RequestResponse, WindowProtocol
from swarm_mj.radio.mission_radio import Belief, TrueLinks
from swarm_mj.system.arguments import check_kind, name_of

LARGEST = 2**63 - 1  # among the parameters: replays keep no larger integer
Parameters = Mapping[str, bool | int | float | str | None]  # what a policy was made with, by name


class Policy:
    """A choice of the robot that every robot addresses next, and of the form of a window.

    Subclass `DecentralisedPolicy`, `BroadcastPolicy` or `CentralisedPolicy`, not this class. All
    that follows has a default, which a subclass may replace.

    Attributes:
        about: What the policy says of itself. A class declares its own and never inherits one, so
            that nothing is said of a subclass that decides by other things; None is unknown.
        is_centralised: Whether a centre decides, or each robot by itself.
        uses: The information that it decides by, in a few words, where `about` does not say it.
        payload: What packets carry beyond T, M and P (II-B), in a word; that of `about`, if there
            is one.
    """

    about: About | None = None
    is_centralised: bool = False
    uses: str = ""
    payload: str = NO_PAYLOAD

    def __init_subclass__(cls, **kwargs: object) -> None:
        super().__init_subclass__(**kwargs)
        about = vars(cls).get("about")
        if not isinstance(about, About | None):
            raise TypeError(f"about of {cls.__name__} must be an About, not {about!r:.80}")
        cls.about = about
        if about is not None:
            cls.payload = about.payload_name

    @classmethod
    def for_mission(cls, mission: Mission) -> "Policy":
        """Return the policy for a mission, as `make_policy` does by its name.

        Every policy of the package says how it is made; one of yours needs not, since the command
        line calls what `module:Name` names.

        Args:
            mission: What is flown; its preset says how the paper's baselines behave.

        Raises:
            ValueError: If the policy cannot fly the mission.
        """
        raise NotImplementedError(f"{cls.__name__} does not say how a mission's is made")

    def window(self, mission: Mission) -> WindowProtocol:
        """Return what the robots do in a window: by Alg. 1 they request, and respond.

        Args:
            mission: It says whether a silent robot notes having addressed itself.

        Returns:
            The form of a window, which `Swarm` plays.
        """
        return RequestResponse(silence_is_attempt=mission.silence_is_attempt)

    def payload_fields(self, mission: Mission) -> tuple[PacketField, ...]:  # noqa: ARG002
        """Return the fields that packets have beyond T, M and P; their bytes then count.

        Args:
            mission: Its numbers say how wide the fields must be.

        Returns:
            The fields, in the order in which a packet has them; none unless the policy has a
            payload.
        """
        return ()

    def packet(self, mission: Mission) -> Packet:
        """Return the packet of the policy in a mission, with all entries that a slot holds.

        Args:
            mission: Its team, area and bit rate say how large packets are and may be.

        Returns:
            The packet: T, M and P of as many robots as fit into a slot, and the payload's fields.

        Raises:
            ValueError: If a slot holds not even one entry beside the payload.
        """
        packet = packet_of(mission, self.payload_fields(mission))
        return fitting(packet, mission, type(self).__name__)

    @property
    def carries_more(self) -> bool:
        """True if its packets carry more than T, M and P (II-B)."""
        return self.payload != NO_PAYLOAD

    @property
    def parameters(self) -> Parameters:
        """Numbers that the policy was made with, by name; results keep them."""
        return {}

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Prepare for new missions, which are flown side by side; forget those before.

        Args:
            num_robots: N, the robots in each mission.
            rngs: A generator for each mission. A policy draws for mission b from the b-th only, so
                that a mission does not depend on those beside it.
        """


def check_parameters(policy: Policy) -> None:
    """Raise ValueError for a parameter that a file of results could not hold."""
    whose = type(policy).__name__
    if not isinstance(policy.parameters, Mapping):
        raise ValueError(
            f"parameters of {whose} must be a dictionary of numbers by their names, not "
            f"{policy.parameters!r:.80}"
        )
    for name, value in policy.parameters.items():
        if not isinstance(name, str):
            raise ValueError(f"a parameter of {whose} must have a text as its name, not {name!r}")
        if value is not None and type(value) not in (bool, int, float, str):
            raise ValueError(
                f"parameter {name} of {whose} must be a plain number, a text, True or False, not "
                f"{value!r:.80} of the type {type(value).__name__}; convert it"
            )
        if isinstance(value, float) and not math.isfinite(value):
            way_out = "give it a number, or None"
            raise ValueError(f"parameter {name} of {whose} must be finite, not {value}; {way_out}")
        if isinstance(value, int) and not -LARGEST <= value <= LARGEST:
            size = f"one of {value.bit_length() + 1}"
            raise ValueError(
                f"parameter {name} of {whose} must be an integer of 64 bits at most, not {size}; "
                "make it a float"
            )


def packet_by(policy: Policy, mission: Mission) -> Packet:
    """Return what a policy's packets hold.

    Raises:
        ValueError: It never fits into a slot, or is no packet.
        TypeError: It is no policy, or says its parameters wrongly.
    """
    check_kind("policy", policy, Policy, 'make_policy("planner", mission)')
    check_parameters(policy)
    packet = policy.packet(mission)
    if not isinstance(packet, Packet):
        raise ValueError(f"packet() of {name_of(policy)} must return a Packet, not {packet!r:.80}")
    return packet


class DecentralisedPolicy(Policy, ABC):
    """A policy that every robot evaluates on its own view (Eq. 9).

    In a window each robot requests from the robot that it addresses, which responds if it decodes
    the request (Alg. 1).

    Example:
        >>> class AskTheStalest(DecentralisedPolicy):
        ...     def recipients(self, views):
        ...         return np.argmin(views.buffers.timestamp, axis=2)
    """

    def inform(self, belief: Belief) -> None:
        """Receive, before `start`, what all robots know of the channel.

        Args:
            belief: Its powers, and whatever else `--prior-knowledge` grants of it.
        """
        self._belief = belief

    @abstractmethod
    def recipients(self, views: LocalViews) -> Int[np.ndarray, "B N"]:
        """Return the robot that each robot addresses in the next window.

        Args:
            views: What each robot knows: its buffer, the clock, the last slots. Arrays are
                read-only; b counts missions and i robots.

        Returns:
            Indices of robots, [B N]: at [b, i] the one that robot i addresses, or i itself for
            silence. Row [b, i] may depend on view [b, i] only.
        """


def two_broadcasts(mission: Mission) -> DoubleBroadcast:
    """Return the window of policies that broadcast twice, unanswered, in a mission.

    Args:
        mission: As in `BroadcastPolicy.window`.
    """
    return DoubleBroadcast(
        silence_is_attempt=mission.silence_is_attempt,
        needs_addressees=mission.recipient_hears_while_sending,
    )


class BroadcastPolicy(DecentralisedPolicy):
    """A decentralised policy whose packets are for everyone who hears them (IV-C).

    It decides before each slot, two a window, and nobody answers.

    Example:
        >>> class InTurn(BroadcastPolicy):
        ...     def transmits(self, views):
        ...         slot = (2 * views.now[:, None]).astype(int)
        ...         return views.silence == slot % views.num_robots
    """

    def window(self, mission: Mission) -> WindowProtocol:
        """Return what the robots do in a window: they broadcast twice, unanswered.

        Args:
            mission: It says whether a silent robot notes having addressed itself, and
                whether its half-duplex rule makes a broadcast name an addressee.

        Returns:
            The form of a window, which `Swarm` plays.
        """
        return two_broadcasts(mission)

    @abstractmethod
    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return who broadcasts in the next slot.

        Args:
            views: What each robot knows, as in `DecentralisedPolicy.recipients`.

        Returns:
            True at [b, i] if robot i transmits; it may depend on view [b, i] only.
        """

    def recipients(self, views: LocalViews) -> Int[np.ndarray, "B N"]:
        """Return `BROADCAST` for robots that transmit in the next slot, by `transmits`.

        Args:
            views: What each robot knows, as in `DecentralisedPolicy.recipients`.

        Returns:
            At [b, i], of [B N], `BROADCAST`, or i itself for silence.

        Raises:
            ValueError: If `transmits` does not return an array of bool, [B N].
        """
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
    position_m: Float[np.ndarray, "N N D"]  # M^{i,j} [m]
    velocity_mps: Float[np.ndarray, "N N D"]  # M^{i,j} [m/s]
    parent: Int[np.ndarray, "N N"]  # P^{i,j}
    heard: Int[np.ndarray, "N"]  # whom i decoded in the last slot; itself: nobody


def team_views(views: LocalViews) -> list[TeamView]:
    """Return the views mission by mission, for policies that remember each on its own."""
    buffers = views.buffers
    heard = views.last_heard
    each = []
    for b, now in enumerate(views.now.tolist()):
        view = TeamView(
            now=now,
            is_known=buffers.is_known[b],
            timestamp=buffers.timestamp[b],
            position_m=buffers.position_m[b],
            velocity_mps=buffers.velocity_mps[b],
            parent=buffers.parent[b],
            heard=heard[b],
        )
        each.append(view)
    return each


class CentralisedPolicy(Policy, ABC):
    """A policy that knows the truth: everyone's buffer and everyone's true state.

    Example:
        >>> class CallTheFirst(CentralisedPolicy):
        ...     def recipients(self, views, states):
        ...         return np.zeros_like(views.silence)
    """

    is_centralised = True  # unless the truth stands in for what each robot senses

    def inform(self, truth: TrueLinks) -> None:
        """Receive, before `start`, the true links before their fades.

        Args:
            truth: The channel that packets take, whatever robots believe of it.
        """
        self._truth = truth

    @abstractmethod
    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """Return the robot that each robot addresses in the next window.

        Args:
            views: What each robot knows, as in `DecentralisedPolicy.recipients`.
            states: Where all robots truly are [m] and how fast [m/s]: `position_m` and
                `velocity_mps` [B N D].

        Returns:
            Indices of robots, [B N]: at [b, i] the one that robot i addresses, or i itself for
            silence.
        """
