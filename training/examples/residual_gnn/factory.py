"""Residual policies of a mission, as `--policy residual_gnn:policy` and the training make them."""

from pathlib import Path

from residual_gnn.network import Weights
from residual_gnn.policy import ResidualPolicy
from residual_gnn.rule import RestingRule
from residual_gnn.stored import SHIPPED, load_weights
from swarm_mj.mission import Mission
from swarm_mj.protocol.packets import fits, packet_of
from swarm_mj.radio.mission_radio import radio_of


def policy(
    mission: Mission, path: Path = SHIPPED, *, is_deterministic: bool = False
) -> ResidualPolicy:
    """Return the policy of a file of weights; raises as `load_weights` and `make_policy` do."""
    return make_policy(load_weights(path), mission, is_deterministic=is_deterministic)


def make_policy(
    weights: Weights, mission: Mission, *, is_deterministic: bool = False
) -> ResidualPolicy:
    """Return the policy that these weights make of a mission's rule.

    Raises:
        ValueError: The team moves, so that there is no rule for it.
    """
    check_stationary(mission)
    radio = radio_of(mission)
    return ResidualPolicy(
        weights,
        RestingRule(radio),
        radio,
        is_deterministic=is_deterministic,
        reads_packets=reads_packets(mission),
    )


def check_stationary(mission: Mission) -> None:
    """Raise ValueError if the mission's team moves: there is no rule for it."""
    if mission.task != "stationary":
        raise ValueError(
            "residual_gnn corrects the plan of stationary teams, and those of "
            f"{mission.task} move; add --task stationary, or fly another policy"
        )


def reads_packets(mission: Mission) -> bool:
    """Return whether a packet holds all of its sender's T as it was before the slot."""
    # By the authors' rule a robot may decode while it transmits, which changes its T in that slot.
    return fits(packet_of(mission), mission) and mission.half_duplex == "strict"
