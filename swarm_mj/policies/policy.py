"""What a policy may know is its type (Eq. 9): local views, or the truth."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.buffers import Buffers
from swarm_mj.protocol import Bodies, Phase

Parameters = Mapping[str, bool | int | float | str]  # what a policy was made with, by name


@dataclass(frozen=True, kw_only=True)
class LocalViews:
    """What the robots know, one view a robot: `[b, i]` in every array belongs to robot i alone.

    Identities are the index i, the team's size is N; both are granted before the mission (II-C).
    The buffers are live: they cannot be written, and change with the next window.
    """

    buffers: Buffers  # robot i's buffer is row [b, i]
    now: Float[np.ndarray, "B"]  # t on the synchronised clock [windows]
    phases: tuple[Phase, ...]  # since the last window began: whom robot i addressed and heard

    @property
    def num_robots(self) -> int:
        """N, known to everyone before the mission (II-C)."""
        return self.buffers.timestamp.shape[1]

    @property
    def silence(self) -> Int[np.ndarray, "B N"]:
        """The recipients that mean silence: everyone addresses itself."""
        num_missions, num_robots = self.buffers.timestamp.shape[:2]
        return np.broadcast_to(np.arange(num_robots), (num_missions, num_robots))


class Policy:
    """Chooses whom every robot addresses in the next window; itself is silence."""

    transmits_twice: ClassVar[bool] = False  # flooding's window: two transmissions, no responses
    moves_each_transmission: ClassVar[bool] = False  # where the mission's field of that name is set

    @property
    def carries_payload(self) -> bool:
        """Whether packets carry more than T, M and P (II-B); the paper's bandwidth has no limit."""
        return False

    @property
    def parameters(self) -> Parameters:
        """What the policy was made with, by name; kept beside what it costs."""
        return {}

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Prepares for new missions; policies that draw or remember say more.

        Args:
            num_robots: N.
            rngs: One generator per mission.
        """


class DecentralisedPolicy(Policy, ABC):
    """A policy that every robot evaluates on its own view (Eq. 9)."""

    @abstractmethod
    def recipients(self, views: LocalViews) -> Int[np.ndarray, "B N"]:
        """Whom each robot addresses; row [b, i] may depend on view [b, i] only.

        Args:
            views: All robots' views, side by side.

        Returns:
            The recipients; itself is silence.
        """


class CentralisedPolicy(Policy, ABC):
    """A policy that is told the truth: everyone's buffer and everyone's true state."""

    @abstractmethod
    def recipients(self, views: LocalViews, bodies: Bodies) -> Int[np.ndarray, "B N"]:
        """Whom each robot addresses.

        Args:
            views: All robots' views.
            bodies: All robots' true states.

        Returns:
            The recipients; itself is silence.
        """


def check_probability(probability: float) -> float:
    """The probability itself.

    Raises:
        ValueError: It is not in [0, 1].
    """
    if not 0.0 <= probability <= 1.0:
        raise ValueError(f"transmission probability must be from 0 to 1, not {probability:g}")
    return probability
