"""How policies fly: options of `fly` and `evaluate` alike."""

from dataclasses import dataclass
from typing import Any

from swarm_mj.mission.components import GROUP, SHOWN_AS, OwnParts
from swarm_mj.policies.registry import PAYLOADS, POLICIES, WITHOUT_PAYLOAD
from swarm_mj.system.fields import setting

NAMED = tuple(name for name in POLICIES if name != WITHOUT_PAYLOAD)  # `--payload` makes the other
NAMES = f"who talks when (`swarm-mj policies` says more): {', '.join(NAMED)}"
OTHERS = "directories or .safetensors files of learned policies, or module:Name of your own"
HEADING = "policies"


@dataclass(frozen=True, kw_only=True)
class PolicyOptions(OwnParts):
    """Options that change a policy, or what it flies in."""

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
    features: tuple[str, ...] = setting(
        (), "that a learned policy was trained on; give them again", group=GROUP, metavar=SHOWN_AS
    )

    @property
    def parts(self) -> OwnParts:
        """The parts that are the user's own."""
        return OwnParts(**self.named)

    @property
    def how(self) -> dict[str, Any]:
        """What `make_policy` takes beside a policy's name and a mission."""
        return {
            "probability": self.probability,
            "is_deterministic": self.is_deterministic,
            "features": self.features,
        }
