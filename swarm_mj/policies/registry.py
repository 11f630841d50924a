"""The one table of policies by their names on the command line.

A learned policy has no name but that of the directory that holds it, except the shipped one, `gnn`.
"""

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from swarm_mj.io.assets import asset
from swarm_mj.mission import Mission
from swarm_mj.policies.aloha import Aloha
from swarm_mj.policies.gossip import InnovationGossip
from swarm_mj.policies.greedy_oracle.policy import GreedyOracle, LookaheadOracle
from swarm_mj.policies.minimum_spanning_tree import MinimumSpanningTree
from swarm_mj.policies.planner.policy import Planner
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.planner.without_payload import PlannerWithoutPayload
from swarm_mj.policies.policy import Policy
from swarm_mj.policies.random_flooding import RandomFlooding
from swarm_mj.policies.round_robin import RoundRobin
from swarm_mj.policies.spatial_tdma import SpatialTdma
from swarm_mj.policies.tdma import Tdma
from swarm_mj.policies.tuning import tuned_probability
from swarm_mj.radio.free_space import from_db
from swarm_mj.radio.mission_radio import radio_of


def _random_flooding(mission: Mission, probability: float | None) -> Policy:
    return RandomFlooding(
        _or_tuned(probability, "random-flooding", mission),
        names_addressee=mission.half_duplex == "eavesdroppers",
    )


def _round_robin(mission: Mission, probability: float | None) -> Policy:  # noqa: ARG001
    _refuse(probability, "round-robin")
    return RoundRobin()


def _mst(mission: Mission, probability: float | None) -> Policy:
    return MinimumSpanningTree(
        _or_tuned(probability, "mst", mission),
        is_recomputed=mission.tree_recomputed,
        root_transmits=mission.tree_root_transmits,
    )


def _aloha(mission: Mission, probability: float | None) -> Policy:
    return Aloha(_or_tuned(probability, "aloha", mission), range_m=mission.range_m)


def _gossip(mission: Mission, probability: float | None) -> Policy:
    return InnovationGossip(_or_tuned(probability, "gossip", mission))


def _tdma(mission: Mission, probability: float | None) -> Policy:  # noqa: ARG001
    _refuse(probability, "tdma")
    return Tdma()


def _spatial_tdma(mission: Mission, probability: float | None) -> SpatialTdma:
    _refuse(probability, "spatial-tdma")
    return SpatialTdma(range_m=mission.range_m, threshold=from_db(mission.sinr_threshold_db))


def _planner(mission: Mission, probability: float | None) -> Policy:
    _refuse(probability, "planner")
    return Planner(
        radio_of(mission),
        PlannerSettings(),
        window_s=mission.window_s,
        range_m=mission.range_m,
        side_m=mission.side_m,
    )


def _planner_without_payload(mission: Mission, probability: float | None) -> Policy:
    _refuse(probability, WITHOUT_PAYLOAD)
    return PlannerWithoutPayload(radio_of(mission), PlannerSettings(), _spatial_tdma(mission, None))


def _oracle(mission: Mission, probability: float | None) -> Policy:
    _refuse(probability, "greedy-oracle")
    return GreedyOracle(radio_of(mission))


def _oracle_lookahead(mission: Mission, probability: float | None) -> Policy:
    _refuse(probability, "oracle-lookahead")
    return LookaheadOracle(radio_of(mission))


WITHOUT_PAYLOAD = "planner --payload none"  # packets carry T, M and P alone
PAYLOADS = ("snapshots", "none")
RULES: dict[str, Callable[[Mission, float | None], Policy]] = {
    "random-flooding": _random_flooding,
    "round-robin": _round_robin,
    "mst": _mst,
    "aloha": _aloha,
    "gossip": _gossip,
    "tdma": _tdma,
    "spatial-tdma": _spatial_tdma,
    "planner": _planner,
    WITHOUT_PAYLOAD: _planner_without_payload,
    "greedy-oracle": _oracle,
    "oracle-lookahead": _oracle_lookahead,
}
SHIPPED = "gnn"  # the learned policy that comes with the package, in assets/policies/
POLICIES = (*RULES, SHIPPED)


def is_learned(name: str) -> bool:
    """Whether a policy is a trained network: the shipped one, or one in a directory."""
    return name == SHIPPED or is_directory(name)


def is_directory(name: str) -> bool:
    """Whether a policy's name is that of a directory: it has a separator, or there is one."""
    return name not in POLICIES and (_is_path(name) or os.path.isdir(name))


def normalised(name: str) -> str:
    """A policy's name as typed, but a directory's without what does not change where it leads."""
    if not is_directory(name):
        return name
    plain = os.path.normpath(name)
    return plain if is_directory(plain) else os.path.join(os.curdir, plain)


def with_payload(names: Sequence[str], payload: str) -> list[str]:
    """Names of policies whose packets carry this beyond T, M and P, where they can carry anything.

    Raises:
        ValueError: No such payload, or no policy that can go without.
    """
    if payload not in PAYLOADS:
        raise ValueError(f"payload must be one of {', '.join(PAYLOADS)}, not {payload!r}")
    if payload == "snapshots":
        return list(names)
    if not {"planner", WITHOUT_PAYLOAD} & set(names):
        raise ValueError(
            f"payload must be that of policy planner, but packets of {', '.join(names)} carry "
            "none; leave out --payload"
        )
    return [WITHOUT_PAYLOAD if name == "planner" else name for name in names]


def make_policy(
    name: str,
    mission: Mission,
    probability: float | None = None,
    *,
    is_deterministic: bool = False,
) -> Policy:
    """A policy by its name on the command line.

    Args:
        name: One of `POLICIES`, or a directory with a learned policy.
        mission: Whose preset says how the baseline behaves where paper and code differ, and whose
            numbers normalise what a learned policy sees.
        probability: Of transmission, for the policies that have one; None is the one tuned for
            the regime nearest to the mission's.
        is_deterministic: Whether a learned policy takes the most probable recipient instead of a
            draw.

    Returns:
        The policy.

    Raises:
        ValueError: Unknown name, a directory without a sound policy, a probability that is out of
            range or not the policy's, or a policy that is not learned made deterministic.
        OSError: A learned policy cannot be read.
    """
    if is_learned(name):
        _refuse(probability, name)
        from swarm_mj.policies.stored import load_policy  # torch takes its time to import

        folder = asset(f"policies/{SHIPPED}") if name == SHIPPED else Path(name)
        return load_policy(folder, mission, is_deterministic=is_deterministic)
    if name not in RULES:
        raise ValueError(
            f"policy must be one of {', '.join(POLICIES)}, or a directory with a learned policy, "
            f"not {name!r}"
        )
    if is_deterministic:
        raise ValueError(f"{name} draws from no network's distribution; leave --deterministic out")
    return RULES[name](mission, probability)


def _is_path(name: str) -> bool:
    return any(separator in name for separator in (os.sep, os.altsep) if separator)


def _or_tuned(probability: float | None, name: str, mission: Mission) -> float:
    return tuned_probability(name, mission) if probability is None else probability


def _refuse(probability: float | None, name: str) -> None:
    """Raises ValueError if a policy that has no probability is given one."""
    if probability is not None:
        raise ValueError(f"{name} takes no transmission probability; leave out {probability:g}")
