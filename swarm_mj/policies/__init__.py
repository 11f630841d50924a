"""Communication policies (IV-C), one file for each kind; `registry` knows their names."""

from swarm_mj.policies.policy import BroadcastPolicy, CentralisedPolicy, DecentralisedPolicy, Policy
from swarm_mj.policies.registry import POLICIES, make_policy
from swarm_mj.protocol.window import LocalViews

__all__ = [
    "POLICIES",
    "BroadcastPolicy",
    "CentralisedPolicy",
    "DecentralisedPolicy",
    "LocalViews",
    "Policy",
    "make_policy",
]
