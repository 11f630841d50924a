"""How policies fly: options of `fly` and `evaluate` alike."""

from dataclasses import dataclass

from swarm_mj.fields import setting
from swarm_mj.policies.registry import PAYLOADS, POLICIES, WITHOUT_PAYLOAD

NAMED = tuple(name for name in POLICIES if name != WITHOUT_PAYLOAD)  # `--payload` makes the other
NAMES = f"who talks to whom: {', '.join(NAMED)}"
HEADING = "policies"


@dataclass(frozen=True, kw_only=True)
class PolicyOptions:
    """Options that change a policy."""

    probability: float | None = setting(
        None,
        "of a transmission, for policies that have one",
        low=0.0,
        high=1.0,
        shown="tuned for the regime",
        group=HEADING,
    )
    is_deterministic: bool = setting(
        False, "learned policies take the most probable recipient, not a draw", group=HEADING
    )
    payload: str = setting(
        PAYLOADS[0],
        "what the planner's packets carry beyond the buffers T, M and P",
        choices=PAYLOADS,
        group=HEADING,
    )
