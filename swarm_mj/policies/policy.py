"""What a policy may know is its type (Eq. 9): local views, or the truth."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
from jaxtyping import Int

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.local_views import LocalViews

Parameters = Mapping[str, bool | int | float | str]  # what a policy was made with, by name


class Policy:
    """Chooses whom every robot addresses in the next window; itself is silence."""

    transmits_twice: ClassVar[bool] = False  # flooding's window: two transmissions, no responses
    moves_each_transmission: ClassVar[bool] = False  # where the mission's field of that name is set

    @property
    def payload(self) -> str:
        """What packets carry beyond T, M and P (II-B); "none" is what the paper's carry."""
        return "none"

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
    def recipients(self, views: LocalViews, bodies: RobotStates) -> Int[np.ndarray, "B N"]:
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
