"""The ways to train: what each one learns, and how long it usually takes."""

from dataclasses import dataclass
from typing import Literal

TrainedPolicy = Literal["gnn", "index-csma"]
CreditAssignment = Literal["robot", "team"]  # of networks: per robot, per team


@dataclass(frozen=True, kw_only=True)
class Way:
    """A way to train."""

    label: str  # in a few words
    is_network: bool  # that PPO trains; otherwise an index, by evolution
    step: str  # after which a run may stop
    budget: int  # team decisions, unless others are asked for
    patience: int  # evaluations without improvement, likewise


ROBOT = Way(label="credit per robot", is_network=True, step="rollout", budget=200_000, patience=8)
# The budget is the paper's.
TEAM = Way(label="credit per team", is_network=True, step="rollout", budget=2_000_000, patience=40)
INDEX = Way(
    label="index-csma by evolution",
    is_network=False,
    step="generation",
    budget=2_000_000,
    patience=8,
)


def way_of(policy: TrainedPolicy, credit: CreditAssignment) -> Way:
    """Return the way to train a policy, by the credit that counts if it is a network."""
    if policy == "index-csma":
        return INDEX
    return TEAM if credit == "team" else ROBOT
