"""Policies' words on themselves, as plain values: for lists on terminals, in JSON and on pages."""

import inspect
from typing import Any

from swarm_mj.mission import Mission
from swarm_mj.policies.policy import Policy
from swarm_mj.policies.registry import about_of, flown_name
from swarm_mj.protocol.packets import PacketField, times

# The forms of a window.
BROADCASTS = "broadcasts"
REQUEST = "request"


def facts_of(name: str, policy: Policy, mission: Mission) -> dict[str, Any]:
    """Return a policy's description of itself, as `swarm-mj policies --json` has it.

    Args:
        name: By which it flies.
        policy: The policy, made for the mission.
        mission: On which its packets and probabilities depend.
    """
    kind = type(policy)
    packet = policy.packet(mission)
    about = policy.about
    entries = [times(field, packet.num_entries) for field in packet.entry]
    return {
        "name": name,
        "is_centralised": policy.is_centralised,
        "window": BROADCASTS if policy.window(mission).is_broadcast else REQUEST,
        "uses": _uses(name, policy, mission),
        "beyond_paper": None if about is None else [kind.label for kind in about.beyond],
        "payload": policy.payload,
        "packet_bytes": packet.num_bytes,
        "packet_fields": [
            _field_facts(field) for field in (*packet.header, *entries, *packet.payload)
        ],
        "probability": policy.parameters.get("probability"),
        "parameters": dict(policy.parameters),
        "class": f"{kind.__module__}.{kind.__qualname__}",
        "description": inspect.getdoc(kind) or "",
    }


def _field_facts(field: PacketField) -> dict[str, Any]:
    """Return what `--json` has of a packet's field; of counts and choices, no step."""
    facts: dict[str, Any] = {"name": field.name, "bits": field.bits, "count": field.count}
    if field.unit:
        facts["step"] = field.step
        facts["unit"] = field.unit
    return facts


def _uses(name: str, policy: Policy, mission: Mission) -> str:
    """Return the information that a policy decides by, in a few words; empty if it is unknown."""
    # Where another policy flies under this name, the name's own words say so.
    about = policy.about if flown_name(name, mission) == name else about_of(name)
    return policy.uses if about is None else about.uses


def carried(policy: Policy) -> str:
    """Return what packets carry beyond T, M and P, with its meaning if the policy says it."""
    payload = None if policy.about is None else policy.about.payload
    return policy.payload if payload is None else f"{payload.name}: {payload.meaning}"
