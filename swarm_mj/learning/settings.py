"""Settings of a training run, and their defaults for both kinds of credit assignment."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

from swarm_mj.learning.ways import CreditAssignment, TrainedPolicy, Way, way_of
from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import MAX_SEED
from swarm_mj.policies.gnn.feature_sets import FEATURE_SETS, is_own_set, num_features
from swarm_mj.policies.policy_config import LEAST_BOUND, NO_BOUND, GnnShape, check_fit
from swarm_mj.protocol.mission_costs import (
    AOI,
    BY_REWARD,
    VELOCITY_VARIANCE,
    MissionCost,
    Reward,
)
from swarm_mj.simulation.components import Components
from swarm_mj.system.fields import as_typed, check, check_value, common_setting, setting
from swarm_mj.system.user_code import files_named

CreditScaling = Literal["none", "kind"]  # as they are, by what is usual in their kind of mission
Device = Literal["auto", "cpu", "cuda"]  # auto: cuda if torch finds one
LEARNED_COSTS = (AOI, VELOCITY_VARIANCE)  # that a run can lower
# First seeds of missions, apart from each other: the missions that chose a policy would flatter its
# cost. Training and environments draw from 2^40 on.
HELD_OUT_SEED = 500_000  # of evaluations during training
CHOICE_SEED = 510_000  # of those that choose a policy
TEST_SEED = 520_000  # of those that tell its cost
EVEN_SILENCE = math.log(39)  # among 40 equal logits, silence is as likely as speech
USUAL_SILENCE = 5.5  # training begins with one of 40 robots in seven speaking
# Where an order of turns lets a robot speak, the others begin all but silent.
ORDERLY_SILENCE = 7.0
USUAL_HORIZON = 8  # [windows]
TRAIN_WINDOWS = (40, 250)  # long missions and short ones should end well alike
# A generation is thousands of decisions, so an evaluation every 10,000 would follow each of them.
INDEX_EVALUATED_EVERY = 200_000
MAX_ROBOTS = 200  # a team decision takes robots² nodes
MAX_DECISIONS = 10**12


@dataclass(frozen=True, kw_only=True)
class PpoSettings:
    """PPO, in stable-baselines3's terms; each field says its meaning and its range.

    The defaults are those of credit per robot, except for `horizon`: `usual_settings` makes it
    `USUAL_HORIZON`, but stored runs that say nothing of it had 1.

    Raises:
        ValueError: A value is not of its kind or out of its range, or `horizon` is longer than
            `num_steps`.

    Example:
        >>> PpoSettings(learning_rate=3e-4).num_epochs
        2
    """

    learning_rate: float = setting(
        1e-3,
        "of Adam, at the start",
        label="learning rate",
        low=1e-9,
        high=1.0,
    )
    decay: float = setting(0.95, low=0.0, high=1.0)  # the learning rate is multiplied by it ...
    decay_steps: int = setting(200, low=1, high=10**9)  # ... every this many optimiser steps ...
    least_share: float = setting(0.03, low=0.0, high=1.0)  # ... but not below this share of it
    num_steps: int = setting(
        16,
        "windows of each mission in a rollout",
        label="rollout",
        flag="--rollout-windows",
        low=1,
        high=100_000,
    )
    num_minibatches: int = setting(
        10, "into how many a rollout is divided", label="minibatches", low=1, high=10**6
    )
    num_epochs: int = setting(2, "passes over a rollout", low=1, high=1000)
    # News is passed on, and spares others repeating it: its worth shows later. Runs whose settings
    # say nothing of it had a horizon of 1. It is at most a rollout.
    horizon: int = setting(
        1,
        "windows over which a packet's credit is summed up, from its own on",
        label="credit-horizon",
        flag="--credit-horizon",
        shown=f"{USUAL_HORIZON}, at most half a rollout; 1 with a discount, team: 1",
        low=1,
        high=100_000,
    )
    discount: float = setting(
        0.0,
        "gamma; 0: a packet earns its own credit alone, not what later packets earn",
        low=0.0,
        high=1.0,
    )
    gae_lambda: float = setting(0.9, low=0.0, high=1.0)  # of the generalised advantage estimate
    clip: float = setting(0.2, low=1e-12, high=1e6)  # how far the probability ratio may be from 1
    clips_value: bool = False  # by the same number
    entropy: float = setting(0.002, "weight of the entropy bonus", low=0.0, high=10.0)
    value: float = setting(0.5, low=0.0, high=1.0)  # weight of the value's squared error
    max_gradient_norm: float = setting(0.5, low=1e-12, high=1e6)  # to which gradients are clipped
    adam_epsilon: float = setting(1e-6, low=1e-12, high=1e6)
    # Packets that have a credit, for each that is sent, without discount: robots might have sent
    # the others.
    considered: float = setting(5.0, low=1.0, high=1000.0)
    # The share of the average of weights, which flies, that each rollout keeps; 0: no average.
    kept: float = setting(0.95, low=0.0, high=0.9999)

    def __post_init__(self) -> None:
        check(self)
        if self.horizon > self.num_steps:
            raise ValueError(
                f"credit-horizon {self.horizon} is longer than a rollout; choose at most "
                f"{self.num_steps}, or more --rollout-windows"
            )


@dataclass(frozen=True, kw_only=True)
class EvolutionSettings:
    """The search for the numbers of `index-csma`, by `evolution`.

    Args:
        candidates: Policies of a generation, which fly the same missions.
        first_step: The size of its first steps, over those that `index.weights` calls worth a try.

    Raises:
        ValueError: A value is not of its kind, or out of its range.
    """

    candidates: int = setting(12, low=4, high=1000)
    first_step: float = setting(0.5, low=1e-6, high=10.0)

    def __post_init__(self) -> None:
        check(self)


# PPO with credit per team: III-C and, for what it leaves open, the authors' code.
PAPER_TEAM_PPO = PpoSettings(
    learning_rate=1e-4,
    decay=0.95,
    # A decay every 500 optimiser steps would leave 3e-6 of the rate after the paper's 2 million
    # observations: the code's 5000 are taken.
    decay_steps=5000,
    least_share=0.0,
    num_steps=4,
    num_minibatches=2,  # of 64
    num_epochs=4,
    discount=0.99,
    gae_lambda=0.95,
    clip=0.1,
    clips_value=True,
    entropy=1e-6,
    value=0.5,
    kept=0.0,
)
# The code's value loss has an extra 1/2.
REFERENCE_TEAM_PPO = replace(PAPER_TEAM_PPO, num_minibatches=4, value=0.25)
ROBOTS_NETWORK = GnnShape(
    num_features=num_features("turns"), latent=32, depth=2, receptive_field=1, edges="both"
)


@dataclass(frozen=True, kw_only=True)
class Training:
    """A training run: the same settings make the same policy on the same machine.

    The defaults are those of credit per robot, made to learn in minutes, except for the horizon of
    `ppo`: see `PpoSettings`.

    Args:
        policy: "gnn", a graph neural network that PPO trains, or "index-csma", whose numbers are
            found by evolution; then what is of credit, networks and PPO counts for nothing.
        credit_assignment: "robot", each paid for what its own packets changed, or "team", one
            reward for all.
        mission: What is flown, except for the team's size.
        other_missions: What else is flown, as many windows long; all are trained on together.
        robots: Sizes of the team, from 2 to `MAX_ROBOTS`; several are trained on together. Without
            any, which an index may be, each mission has its own.
        features: What the network sees of each teammate: the name of a feature set, or
            `module:Name`.
        own_network: The class of the network, `module:Name`, if it is a user's own.
        network: The layers of the network that acts; an own one takes what it likes of them.
        shares_trunk: Whether values are one more output of the same network.
        silence_logit: Added to the logit of silence, except in a robot's own turn.
        most_speech: The probability with which a robot speaks in a window at most, except in its
            own turn; 1 is no bound.
        reward: The cost to lower, "aoi" or "velocity-variance"; the latter needs credit per team.
        unknown_age: How much older than the mission a teammate never heard of counts in credits per
            robot [windows].
        credit_scaling: Whether each kind of mission's credits per robot are divided by their root
            mean square of late, "kind", or not, "none".
        ppo: Settings of PPO.
        evolution: Settings of the search for an index.
        missions: Missions flown side by side; of an index, by each candidate of a generation.
        train_windows: Windows after which missions in training begin anew, if they have more: a
            number, or the least and the most of a number drawn for each of them; none is when they
            end. Evaluations always fly whole missions.
        groups: Groups of missions that end at different times.
        seed: The same seed is the same policy.
        evaluate_every: Team decisions between two evaluations.
        held_out: Missions of an evaluation, of each kind.
        components: Parts that are not the mission's own: see `Components`.
        threads: Torch's threads.

    Raises:
        ValueError: A value is unknown, out of range, or does not go with another.

    Example:
        >>> Training(mission=paper("stationary"), robots=(10, 20)).considers_speech
        True
    """

    policy: TrainedPolicy = setting(
        "gnn",
        "what is trained: gnn, a network, by PPO; or index-csma, whose numbers are found by "
        "evolution",
        choices=get_args(TrainedPolicy),
    )
    credit_assignment: CreditAssignment = common_setting(
        "robot",
        "credit assignment, per robot (each is paid for what its own packets changed; learns in "
        "minutes) or per team (one reward for all, the paper's way)",
        label="credit",
        flag="--credit",
        choices=get_args(CreditAssignment),
        former=("arm",),
    )
    mission: Mission
    other_missions: tuple[Mission, ...] = ()
    robots: tuple[int, ...] = common_setting(
        help="size of the team; several are trained on together",
        low=2,
        high=MAX_ROBOTS,
    )
    features: str = setting(
        "turns",
        f"what the network sees of each teammate: {', '.join(FEATURE_SETS)}, or module:Name of "
        "your own",
        reads=files_named,
    )
    own_network: str = setting(
        "",
        "a network of your own in place of the paper's; it may remember what it saw",
        label="network",
        flag="--network",
        metavar="module:Name",
        reads=files_named,
        shown="the paper's",
    )
    network: GnnShape = ROBOTS_NETWORK  # that acts
    shares_trunk: bool = True  # whether values are one more output of the same network
    # Added to the logit of silence, except in a robot's own turn.
    silence_logit: float = setting(
        USUAL_SILENCE,
        "bias towards silence, outside a robot's turn",
        shown=f"{USUAL_SILENCE:g}, extended: {ORDERLY_SILENCE:g}, team: the preset's own",
        low=-100.0,
        high=100.0,
    )
    # A team in which nobody gets through would else jam for good: all think that they are due.
    most_speech: float = setting(
        0.5,
        "probability with which a robot speaks in a window at most, outside its turn; stored with "
        "the policy; 1: no bound",
        label="most-speech",
        low=LEAST_BOUND,
        high=NO_BOUND,
    )
    reward: Reward = common_setting(
        "aoi",
        "the cost to lower; velocity-variance needs --credit team",
        choices=[cost.reward for cost in LEARNED_COSTS],
    )
    # Early on, first news lowers ages by few windows and earns next to nothing.
    unknown_age: float = setting(
        30.0,
        "how much older than the mission a teammate never heard of counts in credits; more lets "
        "robots speak sooner",
        label="unknown-age",
        unit="windows",
        low=0.0,
        high=10_000.0,
    )
    credit_scaling: CreditScaling = setting(
        "none",
        "divide credits by their root mean square of late in each kind of mission, so that no kind "
        "outweighs the others (kind), or not (none)",
        label="credit-scaling",
        choices=get_args(CreditScaling),
        shown="kind with several tasks, ranges or channels, else none",
    )
    ppo: PpoSettings = PpoSettings()
    evolution: EvolutionSettings = EvolutionSettings()
    missions: int = setting(
        16, "flown side by side; index-csma: by each of its candidates", low=1, high=4096
    )
    # The first windows are the hardest: who begins more often practises them more.
    train_windows: tuple[int, ...] = setting(
        TRAIN_WINDOWS,
        "windows after which missions in training begin anew, if they have more; of two, the least "
        "and the most of a number drawn for each; evaluations fly all of --windows",
        label="train-windows",
        low=1,
        high=MAX_DECISIONS,
        shown=f"{as_typed(TRAIN_WINDOWS)}, team and index-csma: --windows",
    )
    groups: int = setting(4, low=1, high=4096)  # of missions that end at different times
    seed: int = common_setting(0, "the same seed is the same policy", low=0, high=MAX_SEED)
    evaluate_every: int = setting(
        10_000,
        "team decisions between two evaluations",
        label="evaluation interval",
        low=1,
        high=MAX_DECISIONS,
    )
    held_out: int = setting(
        12,
        "missions of an evaluation, of each kind: team size, task, range and so on",
        label="held-out missions",
        low=1,
        high=10_000,
    )
    components: Components = setting(Components(), former=("parts",))
    threads: int = setting(1, "torch's threads", low=1, high=256)

    def __post_init__(self) -> None:
        check(self)
        check_fit(self.network, self.features)
        if not self.robots and self.way.is_network:
            raise ValueError("robots must have at least 1 size")
        if not self.way.is_network and self.cost is not AOI:
            raise ValueError(f"reward {self.reward} is of a gnn; choose policy gnn, or reward aoi")
        if len(self.train_windows) > 2 or list(self.train_windows) != sorted(self.train_windows):
            given = " ".join(map(str, self.train_windows))
            raise ValueError(
                f"train-windows must be one number, or the least and the most: {given}"
            )
        self._check_credit()
        for other in self.other_missions:
            self._check_beside(other)

    def _check_credit(self) -> None:
        """Raise ValueError for what does not go with the credit assignment."""
        if self.credit_assignment == "robot" and self.cost is not AOI:
            raise ValueError(f"reward {self.reward} is a team's; choose credit team, or reward aoi")
        if self.ppo.horizon > 1 and not self.considers_speech:
            raise ValueError(
                "credit-horizon sums up credits per robot, without a discount; choose credit robot "
                f"and discount 0, or credit-horizon 1, not {self.ppo.horizon}"
            )
        if self.credit_assignment == "team" and self.unknown_age > 0.0:
            raise ValueError("unknown-age counts in credits per robot; choose credit robot, or 0")
        if self.credit_assignment == "team" and self.credit_scaling != "none":
            raise ValueError("credit-scaling is of credits per robot; choose credit robot, or none")

    def _check_beside(self, other: Mission) -> None:
        """Raise ValueError if a mission cannot be trained on together with the first."""
        if other.num_windows != self.mission.num_windows:
            both = f"{self.mission.num_windows} and {other.num_windows}"
            raise ValueError(f"missions trained on together must have as many windows, not {both}")
        # The preset says how values are made of a team's robots.
        if self.credit_assignment == "team" and other.preset != self.mission.preset:
            both = f"{self.mission.preset} and {other.preset}"
            raise ValueError(f"credit team takes one preset, not {both}; choose credit robot")

    @property
    def way(self) -> Way:
        """How it is trained."""
        return way_of(self.policy, self.credit_assignment)

    @property
    def all_missions(self) -> tuple[Mission, ...]:
        """The missions that are trained on together, except for the team's size."""
        return (self.mission, *self.other_missions)

    @property
    def kinds(self) -> tuple[Mission, ...]:
        """The kinds of missions that are trained on together: each with each size of the team."""
        if not self.robots:
            return self.all_missions
        kinds: list[Mission] = []
        for mission in self.all_missions:
            kinds += [replace(mission, num_robots=num_robots) for num_robots in self.robots]
        return tuple(kinds)

    @property
    def most_robots(self) -> int:
        """The size of the largest team."""
        return max(mission.num_robots for mission in self.kinds)

    @property
    def least_windows(self) -> int:
        """The least windows after which missions in training begin anew."""
        return min((*self.train_windows, self.mission.num_windows))

    @property
    def most_windows(self) -> int:
        """The most windows after which missions in training begin anew."""
        whole = self.mission.num_windows
        return min(max(self.train_windows, default=whole), whole)

    @property
    def cost(self) -> MissionCost:
        """The cost to lower, whose minus a team is paid."""
        return BY_REWARD[self.reward]

    @property
    def own(self) -> dict[str, str]:
        """The names of parts that are a user's own: to go on with them is to run their code."""
        names = {"features": self.features} if is_own_set(self.features) else {}
        if self.own_network:
            names["network"] = self.own_network
        return names | self.components.names

    @property
    def own_options(self) -> str:
        """The options that name them."""
        return " ".join(f"--{kind} {name:.200}" for kind, name in self.own.items())

    @property
    def considers_speech(self) -> bool:
        """True if credits of packets that were not sent teach as much as of those that were."""
        return self.credit_assignment == "robot" and self.ppo.discount == 0.0


def usual_index_settings(mission: Mission, robots: Sequence[int], seed: int = 0) -> Training:
    """Return the usual settings of a search for an index.

    Args:
        mission: What is flown.
        robots: Sizes of the team; several are trained on together.
        seed: The same seed is the same policy.

    Returns:
        The settings; `dataclasses.replace` changes some.

    Raises:
        ValueError: A value is unknown or out of range.

    Example:
        >>> usual_index_settings(paper("flocking"), [40]).evolution.candidates
        12
    """
    return Training(
        policy="index-csma",
        mission=mission,
        robots=tuple(robots),
        seed=seed,
        missions=4,
        train_windows=(),
        evaluate_every=INDEX_EVALUATED_EVERY,
    )


def usual_settings(
    credit: CreditAssignment, mission: Mission, robots: Sequence[int], seed: int = 0
) -> Training:
    """Return the usual settings of credit per `robot` or per `team`, the paper's way (III-C).

    Args:
        credit: "robot" or "team".
        mission: What is flown; its preset says whose way of credit per team, the paper's text or
            the authors' code.
        robots: Sizes of the team; several are trained on together.
        seed: The same seed is the same policy.

    Returns:
        The settings; `dataclasses.replace` changes some.

    Raises:
        ValueError: A value is unknown or out of range.

    Example:
        >>> usual_settings("team", paper("flocking"), [40]).missions
        32
    """
    check_value(Training.__dataclass_fields__["credit_assignment"], credit)
    usual = Training(mission=mission, robots=tuple(robots), seed=seed)
    if credit == "robot":
        return replace(usual, ppo=replace(usual.ppo, horizon=USUAL_HORIZON))
    is_reference = mission.preset == "reference"
    # III-C, or the authors' code: other features, and two numbers per node. Both have the code's
    # edges. Over the text's, which lead from children to parents, nothing of the robot itself
    # reaches a teammate's node: its recipient could depend neither on where it is nor on the time.
    features = "reference" if is_reference else "paper"
    network = GnnShape(
        num_features=num_features(features),
        num_outputs=2 if is_reference else 1,
        edges="reference",
    )
    return replace(
        usual,
        credit_assignment="team",
        features=features,
        network=network,
        shares_trunk=False,
        silence_logit=0.0 if is_reference else EVEN_SILENCE,
        most_speech=NO_BOUND,
        unknown_age=0.0,
        train_windows=(),
        ppo=REFERENCE_TEAM_PPO if is_reference else PAPER_TEAM_PPO,
        missions=32,
    )
