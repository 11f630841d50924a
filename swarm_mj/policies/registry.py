"""The one table of policies by their names on the command line, and `make_policy`.

A name is one of `POLICIES`, the file of a learned policy or its run's folder, or `module:Name` of a
user's own. `gnn` is the learned policy that comes with the package.
"""

import os
import tomllib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from swarm_mj.mission import Mission
from swarm_mj.policies.carrier_sense import AgeGainCsma, CarrierSense, sensed_dbm
from swarm_mj.policies.centralised import MinimumSpanningTree, RoundRobin
from swarm_mj.policies.greedy_oracle import GreedyOracle
from swarm_mj.policies.planner.link_tables import link_fields
from swarm_mj.policies.planner.policy import Planner
from swarm_mj.policies.planner.resting import RestingPlanner
from swarm_mj.policies.policy import CentralisedPolicy, DecentralisedPolicy, Policy
from swarm_mj.policies.policy_config import SUFFIX
from swarm_mj.policies.random_access import Aloha, InnovationGossip, RandomFlooding
from swarm_mj.policies.sotdma.policy import SelfOrganisedTdma
from swarm_mj.policies.tdma import SpatialTdma, Tdma
from swarm_mj.policies.tuning import tuned_probability
from swarm_mj.protocol.packets import fits, packet_of
from swarm_mj.system import needs
from swarm_mj.system.fields import check_kind, did_you_mean
from swarm_mj.system.packages import asset, need
from swarm_mj.system.user_code import is_own, make

WITHOUT_PAYLOAD = "planner --payload none"  # packets carry T, M and P alone
FLOWN_AS = f"{WITHOUT_PAYLOAD} flies as spatial-tdma where robots move: they agree on no plan"
PAYLOADS = ("snapshots", "none")  # the planner's own, which at rest is links, or nothing


def _planner(mission: Mission) -> Planner | RestingPlanner:
    if mission.moves:
        return Planner(mission)
    return RestingPlanner(mission, learns=fits(packet_of(mission, link_fields(mission)), mission))


# What makes each policy, given the mission and, for these, a transmission probability.
HAVE_PROBABILITY = ("random-flooding", "mst", "aloha", "csma", "gossip")
RULES: dict[str, Callable[..., Policy]] = {
    "random-flooding": lambda mission, probability: RandomFlooding(
        probability, names_addressee=mission.half_duplex == "eavesdroppers"
    ),
    "round-robin": lambda _: RoundRobin(),
    "mst": lambda mission, probability: MinimumSpanningTree(
        probability,
        is_recomputed=mission.tree_recomputed,
        root_transmits=mission.tree_root_transmits,
    ),
    "aloha": lambda mission, probability: Aloha(probability, range_m=mission.range_m),
    "csma": lambda mission, probability: CarrierSense(probability, sensed_dbm(mission)),
    "age-gain-csma": AgeGainCsma,
    "gossip": lambda _, probability: InnovationGossip(probability),
    "tdma": lambda _: Tdma(),
    "spatial-tdma": SpatialTdma,
    "sotdma": SelfOrganisedTdma,
    "planner": _planner,
    WITHOUT_PAYLOAD: RestingPlanner,
    "greedy-oracle": GreedyOracle,
}
SHIPPED = "gnn"  # in assets/policies/
_SAID = tomllib.loads(Path(__file__).with_name("uses.toml").read_text("utf-8"))
USES, PAIR_BYTES = _SAID["uses"], _SAID["pair_bytes"]
KINDS: dict[str, str] = _SAID["kinds"]  # of information beyond the paper's
BEYOND: dict[str, list[str]] = _SAID["beyond"]
POLICIES = (*RULES, SHIPPED)


def make_policy(
    name: str,
    mission: Mission,
    probability: float | None = None,
    *,
    is_deterministic: bool = False,
    features: Sequence[str] = (),
) -> Policy:
    """Return a policy by its name, for a mission.

    The mission's preset says how the baselines behave where paper and code differ, and its numbers
    normalise what a learned policy sees. Policies of `HAVE_PROBABILITY` transmit with the one tuned
    for the regime nearest to the mission's unless it is given. A deterministic learned policy takes
    the most probable recipient, not a draw. `features` are own feature sets, as `module:Name`, that
    may be imported for a learned policy.

    Raises ValueError if the name is unknown, no sound policy is there, or the policy takes no such
    probability or mode, OSError if a file cannot be read, TypeError for no name or no mission.
    """
    check_kind("policy", name, str, '"planner"')
    check_kind("mission", mission, Mission, 'paper("flocking")')
    name = flown_name(name, mission)
    if not (name in POLICIES or is_stored(name) or is_own_policy(name)):
        raise ValueError(
            f"policy must be one of {', '.join(POLICIES)}, a run's folder or a {SUFFIX} file with "
            f"a learned policy, or module:Name of your own, not {name!r}"
            f"{did_you_mean(name, POLICIES)}"
        )
    if probability is not None and name not in HAVE_PROBABILITY:
        per_value = "name one policy per value in its file, as `p01 = functools.partial(Mine, 0.1)`"
        hint = f", and {per_value}" if is_own_policy(name) else ""
        raise ValueError(f"{name} takes no transmission probability; leave out {probability}{hint}")
    if is_learned(name):
        return _learned(name, mission, is_deterministic=is_deterministic, features=features)
    if is_deterministic:
        raise ValueError(
            f"--deterministic applies to learned policies only, not to {name}; leave it out"
        )
    if is_own_policy(name):
        return _own(name, mission)
    if name not in HAVE_PROBABILITY:
        return RULES[name](mission)
    return RULES[name](
        mission, tuned_probability(name, mission) if probability is None else probability
    )


def _learned(name: str, mission: Mission, **options: Any) -> Policy:
    # The core of the package flies without these libraries, and torch is slow to import.
    need("torch" if name == SHIPPED else "safetensors", f"policy {name}", "fly another")
    from swarm_mj.policies.stored import load_policy

    path = asset(f"policies/{SHIPPED}{SUFFIX}") if name == SHIPPED else Path(name)
    return load_policy(path, mission, **options)


def _own(name: str, mission: Mission) -> Policy:
    policy = make("policy", name, mission)
    if isinstance(policy, CentralisedPolicy | DecentralisedPolicy):
        return policy
    raise ValueError(
        f"policy {name} must make a DecentralisedPolicy or a CentralisedPolicy, not {policy!r:.80}"
    )


def is_stored(name: str) -> bool:
    """Return whether a policy's name is that of a file or a folder, there or not."""
    is_path = any(separator in name for separator in (os.sep, os.altsep) if separator)
    is_there = os.path.isdir(name) or os.path.isfile(f"{name}{SUFFIX}")
    return name not in POLICIES and (is_path or name.endswith(SUFFIX) or is_there)


def uses_of(name: str, policy: Policy) -> str:
    """Return the information that a policy by this name decides by, if known, in a few words."""
    return policy.uses or USES.get(_entry(name, policy), "")


def beyond_paper(name: str, policy: Policy) -> list[str] | None:
    """Return the kinds of information beyond the paper's that a policy uses; None if unknown."""
    return BEYOND.get(_entry(name, policy))


def _entry(name: str, policy: Policy) -> str:
    payload = "" if policy.payload == "none" else f", {policy.payload}"
    return name.partition(" ")[0] + payload


def is_learned(name: str) -> bool:
    """Return whether a policy is a trained network: the shipped one, or a stored one."""
    return name == SHIPPED or is_stored(name)


def missions_memory(name: str, mission: Mission, num_missions: int = 1) -> float:
    """Return the memory of missions side by side that a policy flies [bytes]."""
    num_robots, policy_pair = mission.num_robots, 0.0
    rounds, pair, robot = PAIR_BYTES.get(name.partition(" ")[0], (0.0, 0.0, 0.0))
    if mission.num_windows > rounds * num_robots:
        policy_pair = pair + robot * num_robots * mission.moves
    learned = is_learned(name)
    return needs.missions_memory(num_robots, num_missions, policy_pair, is_learned=learned)


def is_own_policy(name: str) -> bool:
    """Return whether a policy is a user's own, named `module:Name`."""
    return is_own(name) and not is_stored(name)


def stored_policies(names: Iterable[str]) -> list[Path]:
    """Return the files and folders among policies' names."""
    return [Path(name) for name in names if is_stored(name)]


def listed(names: Iterable[str]) -> list[str]:
    """Return policies' names, each once; `all` stands for `POLICIES`, after the others."""
    names = list(names)
    every = dict.fromkeys((*names, *(POLICIES if "all" in names else ())))
    return [name for name in every if name != "all"]


def flown_name(name: str, mission: Mission) -> str:
    """Return the name of what flies a mission when a policy is asked for.

    Without a payload, robots that move cannot agree on a plan, so they fly `spatial-tdma`. Tables
    and charts say so, and show it once.
    """
    return "spatial-tdma" if name == WITHOUT_PAYLOAD and mission.moves else name


def with_payload(names: Sequence[str], payload: str) -> list[str]:
    """Return the names of policies with this payload; ValueError if none of them has a choice."""
    if payload == "snapshots":
        return list(names)
    if not {"planner", WITHOUT_PAYLOAD} & set(names):
        raise ValueError(
            f"--payload says what the planner's packets carry, but not those of "
            f"{', '.join(names)}; leave it out"
        )
    return [WITHOUT_PAYLOAD if name == "planner" else name for name in names]


def check_used(features: Sequence[str], policies: Iterable[Policy]) -> None:
    """Raise ValueError unless own feature sets that were named are those of some policy."""
    used = {policy.parameters.get("features") for policy in policies}
    for name in features:
        if name not in used:
            raise ValueError(f"no policy here was trained on the features {name}; leave them out")
