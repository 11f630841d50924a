"""Communication policies (IV-C), one file for each kind; `registry` knows their names."""

from swarm_mj.policies.about import (
    FEW_BYTES,
    About,
    Information,
    Look,
    PairMemory,
    Payload,
)
from swarm_mj.policies.policy import BroadcastPolicy, CentralisedPolicy, DecentralisedPolicy, Policy
from swarm_mj.policies.registry import POLICIES, make_policy
from swarm_mj.protocol.window import LocalViews

__all__ = [
    "FEW_BYTES",
    "POLICIES",
    "About",
    "BroadcastPolicy",
    "CentralisedPolicy",
    "DecentralisedPolicy",
    "Information",
    "LocalViews",
    "Look",
    "PairMemory",
    "Payload",
    "Policy",
    "make_policy",
]
