"""The residual policy of a mission."""

from residual_gnn.network import Weights
from residual_gnn.policy import ResidualPolicy
from residual_gnn.resting_rule import RestingRule
from swarm_mj.mission import Mission
from swarm_mj.protocol.packets import fits, packet_of
from swarm_mj.radio.mission_radio import radio_of


def residual_policy(
    weights: Weights, mission: Mission, *, is_deterministic: bool = False
) -> ResidualPolicy:
    """Return the policy that these weights make of a mission's rule.

    Raises:
        ValueError: The mission's team moves: there is no rule for it.
    """
    check_rests(mission)
    radio = radio_of(mission)
    return ResidualPolicy(
        weights,
        RestingRule(radio),
        radio,
        is_deterministic=is_deterministic,
        reads_packets=reads_packets(mission),
    )


def check_rests(mission: Mission) -> None:
    """Raise ValueError if the mission's team moves: there is no rule for it."""
    if mission.task != "stationary":
        raise ValueError(
            f"residual policies are for teams at rest, and those of {mission.task} move; add "
            "--task stationary, or fly another policy"
        )


def reads_packets(mission: Mission) -> bool:
    """Whether a packet holds all of its sender's T as it was before the slot."""
    # By the authors' rule a robot may decode while it transmits, which changes its T in that slot.
    return fits(packet_of(mission), mission) and mission.half_duplex == "strict"
