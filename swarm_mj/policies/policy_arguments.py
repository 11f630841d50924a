"""The arguments that change a policy made by its name, in one struct that is passed on whole."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class PolicyArguments:
    """The arguments of `make_policy` beside the policy's name and the mission."""

    # Of a transmission, for policies that have one; None is the one tuned for the regime.
    probability: float | None = None
    is_deterministic: bool = False  # whether a learned policy takes the most probable recipient
    features: Sequence[str] = ()  # users' own feature sets that a learned policy may import
    networks: Sequence[str] = ()  # users' own networks, likewise


USUAL = PolicyArguments()  # every policy as it is made by its name alone
