"""Communication policies (IV-C), one file each, and the one table of their names."""

from collections.abc import Callable

from swarm_mj.mission import Mission
from swarm_mj.policies.minimum_spanning_tree import MinimumSpanningTree
from swarm_mj.policies.policy import CentralisedPolicy, DecentralisedPolicy, LocalViews, Policy
from swarm_mj.policies.random_flooding import RandomFlooding
from swarm_mj.policies.round_robin import RoundRobin

__all__ = [
    "POLICIES",
    "CentralisedPolicy",
    "DecentralisedPolicy",
    "LocalViews",
    "MinimumSpanningTree",
    "Policy",
    "RandomFlooding",
    "RoundRobin",
    "make_policy",
]

DEFAULT_PROBABILITY = 0.06  # best of 0.04, 0.06, ..., 0.2 for 40 robots in each task (100 missions)


def _random_flooding(mission: Mission, probability: float | None) -> Policy:  # noqa: ARG001
    return RandomFlooding(DEFAULT_PROBABILITY if probability is None else probability)


def _round_robin(mission: Mission, probability: float | None) -> Policy:  # noqa: ARG001
    if probability is not None:
        raise ValueError("round-robin takes no transmission probability")
    return RoundRobin()


def _mst(mission: Mission, probability: float | None) -> Policy:
    return MinimumSpanningTree(
        DEFAULT_PROBABILITY if probability is None else probability,
        is_recomputed=mission.tree_recomputed,
        root_transmits=mission.tree_root_transmits,
    )


POLICIES: dict[str, Callable[[Mission, float | None], Policy]] = {
    "random-flooding": _random_flooding,
    "round-robin": _round_robin,
    "mst": _mst,
}


def make_policy(name: str, mission: Mission, probability: float | None = None) -> Policy:
    """A policy by its name on the command line.

    Args:
        name: A key of `POLICIES`.
        mission: Whose preset says how the baseline behaves where paper and code differ.
        probability: Of transmission, for the policies that have one; None is their default.

    Returns:
        The policy.

    Raises:
        ValueError: Unknown name, or a probability that is out of range or not the policy's.
    """
    if name not in POLICIES:
        raise ValueError(f"policy must be one of {', '.join(POLICIES)}, not {name!r}")
    return POLICIES[name](mission, probability)
