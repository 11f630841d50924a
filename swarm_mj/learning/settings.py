"""What a training run depends on, and what is usual for both kinds of credit assignment."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from swarm_mj.fields import check, setting
from swarm_mj.gnn.feature_sets import FEATURE_SETS, num_features
from swarm_mj.gnn.shape import GnnShape
from swarm_mj.mission import Mission

CreditAssignment = Literal["robot", "team"]  # per robot, per team
Reward = Literal["aoi", "velocity-variance"]
HELD_OUT_SEED = 500_000  # of the first held-out mission; training draws from 2^40 on
EVEN_SILENCE = math.log(39)  # among 40 equal logits, silence is as likely as speech
MOST_ROBOTS = 200  # a team decision takes robots² nodes


@dataclass(frozen=True, kw_only=True)
class PpoSettings:
    """Proximal policy optimisation, in stable-baselines3's terms."""

    learning_rate: float = setting(
        help="of Adam, at the start", label="learning rate", low=1e-9, high=1.0
    )
    decay: float  # of the learning rate ...
    decay_steps: int  # ... in each of so many optimiser steps ...
    least_share: float = 0.0  # ... but not below this share of it
    num_steps: int  # windows of each mission in a rollout
    num_minibatches: int  # that a rollout is shared out to
    num_epochs: int  # passes over a rollout
    discount: float = setting(
        help="gamma; 0: a packet's credit is that of its own window alone", low=0.0, high=1.0
    )
    gae_lambda: float
    clip: float  # of the probability ratio
    clips_value: bool  # by the same number
    entropy: float = setting(help="weight of the entropy bonus", low=0.0, high=10.0)
    value: float  # weight of the value's squared error
    max_gradient_norm: float = 0.5
    adam_epsilon: float = 1e-6

    def __post_init__(self) -> None:
        check(self)


# III-C, and for what it leaves open the authors' code, whose value loss has an extra 1/2. A decay
# every 500 optimiser steps would leave 3e-6 of the rate after the paper's 2 million observations:
# the code's 5000 are taken.
TEAM_REFERENCE = PpoSettings(
    learning_rate=1e-4,
    decay=0.95,
    decay_steps=5000,
    num_steps=4,
    num_minibatches=4,
    num_epochs=4,
    discount=0.99,
    gae_lambda=0.95,
    clip=0.1,
    clips_value=True,
    entropy=1e-6,
    value=0.25,
)
TEAM_PAPER = replace(TEAM_REFERENCE, num_minibatches=2, value=0.5)  # minibatches of 64
ROBOT = PpoSettings(
    learning_rate=1e-3,
    decay=0.95,
    decay_steps=200,
    least_share=0.1,
    num_steps=32,
    num_minibatches=10,
    num_epochs=2,
    discount=0.0,
    gae_lambda=0.9,
    clip=0.2,
    clips_value=False,
    entropy=0.002,
    value=0.5,
)


@dataclass(frozen=True, kw_only=True)
class Training:
    """A training run: the same settings make the same policy on the same machine.

    Raises:
        ValueError: A value is unknown, outside its range, or does not go with another.
    """

    arm: CreditAssignment = setting(
        help="credit assignment, per robot (each is paid for what its own packets changed; learns "
        "in minutes) or per team (one reward for all, the paper's way)",
        choices=get_args(CreditAssignment),
    )
    mission: Mission
    robots: tuple[int, ...] = setting(
        help="size of the team; several are trained on together", low=2, high=MOST_ROBOTS
    )
    features: str = setting(
        help="what the network sees of each teammate", choices=tuple(FEATURE_SETS)
    )
    network: GnnShape  # that acts
    shares_trunk: bool  # whether values come from the acting network's last stage but one number
    silence_logit: float  # what silence has ahead, but in a robot's own turn
    reward: Reward = setting(
        help="the cost to lower; velocity-variance needs --arm team",
        choices=get_args(Reward),
    )
    ppo: PpoSettings
    missions: int = setting(help="flown side by side", low=1, high=4096)
    groups: int  # of missions that end at different times
    seed: int = setting(help="the same seed is the same policy", low=0, high=2**63 - 1)
    evaluate_every: int = setting(
        help="team decisions between two evaluations",
        label="evaluation interval",
        low=1,
        high=10**12,
    )
    held_out: int = setting(
        help="missions of an evaluation, of each team size",
        label="held-out missions",
        low=1,
        high=10_000,
    )
    threads: int = setting(help="torch's threads", low=1, high=256)

    def __post_init__(self) -> None:
        check(self)
        if self.arm == "robot" and self.reward != "aoi":
            raise ValueError(f"reward {self.reward} is a team's; choose arm team, or reward aoi")

    @property
    def sums_nodes(self) -> bool:
        """Whether a team's value sums all nodes of all graphs, as in the authors' code."""
        return self.mission.preset == "reference"

    @property
    def drops_silence(self) -> bool:
        """Whether silent rows, which without discount earn nothing, may be left out."""
        return self.arm == "robot" and self.ppo.discount == 0.0


def usual_settings(arm: str, mission: Mission, robots: Sequence[int], seed: int = 0) -> Training:
    """The usual settings of a credit assignment; `dataclasses.replace` changes some.

    Args:
        arm: `robot`, made to learn in minutes, or `team`, the paper's way (III-C).
        mission: What the missions have in common; its preset says whose way, where they differ.
        robots: Sizes of the teams.
        seed: Of all draws.

    Raises:
        ValueError: A value is unknown or outside its range.
    """
    if arm not in get_args(CreditAssignment):
        raise ValueError(f"arm must be one of {', '.join(get_args(CreditAssignment))}, not {arm!r}")
    given: dict[str, Any] = {"arm": arm, "mission": mission, "robots": tuple(robots), "seed": seed}
    own = _per_robot() if arm == "robot" else _per_team(is_reference=mission.preset == "reference")
    shared = {"reward": "aoi", "groups": 4, "evaluate_every": 10_000, "held_out": 12, "threads": 1}
    return Training(**given, **own, **shared)


def _per_robot() -> dict[str, Any]:
    return {
        "features": "extended",
        "network": GnnShape(
            num_features=num_features("extended"),
            latent=32,
            depth=2,
            receptive_field=1,
            edges="both",
        ),
        "shares_trunk": True,
        "silence_logit": 7.0,
        "ppo": ROBOT,
        "missions": 16,
    }


def _per_team(*, is_reference: bool) -> dict[str, Any]:
    """III-C, or the authors' code: other features, and two numbers per node.

    Both have the code's edges. Over the text's, which lead from children to parents, nothing of the
    robot itself reaches a teammate's node: whom it addresses could depend neither on where it is
    nor on the time.
    """
    features = "reference" if is_reference else "paper"
    return {
        "features": features,
        "network": GnnShape(
            num_features=num_features(features),
            num_outputs=2 if is_reference else 1,
            edges="reference",
        ),
        "shares_trunk": False,
        "silence_logit": 0.0 if is_reference else EVEN_SILENCE,
        "ppo": TEAM_REFERENCE if is_reference else TEAM_PAPER,
        "missions": 32,
    }


def from_json(given: dict[str, Any]) -> Training:
    """The settings whose `dataclasses.asdict` was written.

    Raises:
        ValueError: A key is missing or unknown, or a value is outside its range.
    """
    try:
        parts: dict[str, Any] = {
            "mission": Mission(**given["mission"]),
            "network": GnnShape(**given["network"]),
            "ppo": PpoSettings(**given["ppo"]),
            "robots": tuple(given["robots"]),
        }
        return Training(**given | parts)
    except (KeyError, TypeError) as error:
        raise ValueError(f"not the settings of this version's training runs: {error}") from error
