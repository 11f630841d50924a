"""A study: which policies meet which missions, as batches of them."""

import json
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

from swarm_mj.control.motion import Costed, controller_of
from swarm_mj.evaluation.batch import Batch
from swarm_mj.evaluation.published import BASELINES
from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import MAX_SEED
from swarm_mj.policies import registry
from swarm_mj.policies.policy import Parameters, Policy
from swarm_mj.policies.policy_arguments import PolicyArguments
from swarm_mj.protocol.costs import CostName
from swarm_mj.simulation.components import Components, digest
from swarm_mj.system.fields import check, common_setting, setting
from swarm_mj.system.packages import code_digest, commit, version
from swarm_mj.system.user_code import files_named

DEFAULT_POLICIES = ("planner", *BASELINES)
MAX_REGIMES = 10_000  # each is a `Mission` in memory, with every policy made for it
MAX_MISSIONS = 10_000_000  # days of flying; the list of their batches is made first
BATCH_SIZE = 25  # missions side by side: as fast as many, and little lost by an interruption


@dataclass(frozen=True, kw_only=True)
class Study:
    """The settings of an evaluation; all policies fly the same missions in each regime.

    Args:
        policies: Names among `POLICIES`, `module:Name` of a user's own, or folders of learned ones.
        regimes: The missions' numbers; a regime is flown from each seed.
        episodes: Missions per policy, in each regime.
        seed: Of the first mission; the others follow one by one.
        probability: The transmission probability of random policies; None is each policy's own.
        is_deterministic: Whether learned policies take the most probable recipient.
        features: Users' own extractors that learned policies may load.
        networks: Users' own networks, likewise.
        components: Parts that are not the mission's own: see `Components`.
        baseline: The policy that others are compared with, mission by mission; None is the
            first policy.

    Raises:
        ValueError: There is nothing to evaluate, a policy is unknown, or a number out of range.
    """

    policies: tuple[str, ...] = setting(reads=registry.files_of)
    regimes: tuple[Mission, ...]
    episodes: int = common_setting(100, "missions per policy", low=1, high=10**5)
    seed: int = common_setting(1000, "seed of the first mission; the others follow one by one")
    probability: float | None = setting(None, low=0.0, high=1.0)
    is_deterministic: bool = False
    features: tuple[str, ...] = setting((), reads=files_named)
    networks: tuple[str, ...] = setting((), reads=files_named)
    components: Components = setting(Components(), former=("parts",))
    baseline: str | None = common_setting(
        None,
        "the policy that others are compared with",
        metavar="POLICY",
        shown="the first policy",
    )

    def __post_init__(self) -> None:
        if not self.policies or not self.regimes:
            raise ValueError("an evaluation needs at least 1 policy and 1 regime")
        check(self)
        self._check_number()
        if not 0 <= self.seed <= MAX_SEED - self.episodes + 1:
            raise ValueError(
                f"seed must be from 0 to {MAX_SEED - self.episodes + 1}, the last of "
                f"{self.episodes} missions included, not {self.seed}"
            )
        if self.is_deterministic and not any(map(registry.is_learned, self.policies)):
            raise ValueError(
                "only learned policies can be deterministic, and none is among "
                f"{', '.join(self.policies)}; leave it out, or add one"
            )
        _ = self.parameters  # makes every policy, so that a bad one is refused now
        for regime in self.regimes:
            self.components.made(regime)
        if self.features or self.networks:
            made = (self.make_policy(name, self.regimes[0]) for name in self.policies)
            registry.check_used(self.features, self.networks, made)
        if self.baseline is not None and self.baseline not in self.policies:
            raise ValueError(
                f"baseline must be one of the policies evaluated, {', '.join(self.policies)}, not "
                f"{self.baseline!r}; add it to them"
            )

    def _check_number(self) -> None:
        """Raise ValueError for more work than can be listed, before any of it is."""
        num_regimes = len(self.regimes)
        if num_regimes > MAX_REGIMES:
            raise ValueError(
                f"a study may have up to {MAX_REGIMES} regimes, not {num_regimes}; fly them in "
                "several studies"
            )
        number = self.episodes * num_regimes * len(self.policies)
        if number > MAX_MISSIONS:
            raise ValueError(
                f"a study may have up to {MAX_MISSIONS} missions, not {number} ({self.episodes} "
                f"missions x {num_regimes} regimes x {len(self.policies)} policies); choose fewer"
            )

    @property
    def compared_to(self) -> str:
        """The baseline's name."""
        return self.policies[0] if self.baseline is None else self.baseline

    @property
    def pairs(self) -> list[tuple[Mission, str]]:
        """Every regime with every policy, regime by regime."""
        pairs: dict[tuple[Mission, str], None] = {}  # each once, in order
        for regime in self.regimes:
            for name in self.policies:
                pairs[regime, registry.flown_name(name, regime)] = None
        return list(pairs)

    @property
    def num_missions(self) -> int:
        """How many missions there are, of all policies in all regimes."""
        return self.episodes * len(self.pairs)

    @cached_property
    def batches(self) -> tuple[Batch, ...]:
        """All the work, pair by pair, in the order of the seeds."""
        seeds = range(self.seed, self.seed + self.episodes)
        batches: list[Batch] = []
        for regime, policy in self.pairs:
            for start in range(0, self.episodes, BATCH_SIZE):
                batch = Batch(
                    policy=policy,
                    arguments=self._arguments(policy),
                    components=self.components,
                    parameters=self.parameters[regime, policy],
                    mission=regime,
                    seeds=seeds[start : start + BATCH_SIZE],
                )
                batches.append(batch)
        return tuple(batches)

    @cached_property
    def parameters(self) -> dict[tuple[Mission, str], Parameters]:
        """Parameters of each policy in each regime, as of the start of the study."""
        made: dict[tuple[Mission, str], Parameters] = {}
        for regime, policy in self.pairs:
            made[regime, policy] = self.make_policy(policy, regime).parameters
        return made

    def make_policy(self, policy: str, regime: Mission) -> Policy:
        """Make a policy as it is evaluated in a regime; refuse one whose packets never fit."""
        made = registry.make_policy_with(self._arguments(policy), policy, regime)
        made.packet(regime)
        return made

    def _arguments(self, policy: str) -> PolicyArguments:
        """Return what changes a policy of the study."""
        return PolicyArguments(
            probability=self.probability,
            # The others have no most probable recipient, and refuse to be asked for it.
            is_deterministic=self.is_deterministic and registry.is_learned(policy),
            features=self.features,
            networks=self.networks,
        )

    def task_cost(self, regime: Mission) -> CostName | None:
        """Return the name and the unit of a regime's task cost; None if its controller has none."""
        controller = self.components.made(regime).controller or controller_of(regime)
        if not isinstance(controller, Costed):
            return None
        return CostName(controller.cost_name, controller.cost_unit)

    def config(self, policy: str, regime: Mission) -> dict[str, Any]:
        """All that a policy's missions in a regime depend on, but for their seeds."""
        parameters = self.parameters[regime, policy]
        return {**asdict(regime), "policy": policy, **parameters, **self.components.names}

    def header(self) -> dict[str, Any]:
        """All that the batches' costs depend on, as JSON gives it back."""
        own = [name for name in self.policies if registry.is_own_policy(name)]
        own += [*self.features, *self.networks, *self.components.names.values()]
        header = {
            "version": version(),
            "commit": commit(),
            "code": code_digest(),
            "episodes": self.episodes,
            "seed": self.seed,
            "missions side by side": BATCH_SIZE,
            "own code": {name: digest(name) for name in own},
            "baseline": self.compared_to,
            "policies and regimes": [self.config(policy, regime) for regime, policy in self.pairs],
        }
        return json.loads(json.dumps(header))
