"""`swarm-mj policies`: who talks when, what each policy knows, what its packets carry."""

import inspect
import json
import shlex
import sys
from dataclasses import dataclass
from typing import Any, ClassVar

from rich.console import Console
from rich.table import Column, Table

from swarm_mj.cli.mission_options import mission_flags, one_mission
from swarm_mj.mission import Mission
from swarm_mj.policies.policy import Policy
from swarm_mj.policies.registry import POLICIES, SHIPPED, flown_name, make_policy, normalised
from swarm_mj.protocol.packets import times
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import as_typed, setting
from swarm_mj.system.packages import is_installed, missing
from swarm_mj.system.terminal import named_values, plain_console, this_command

WINDOWS = {
    "broadcasts": "two broadcasts, which nobody answers",
    "request": "a request to one robot, and its answer",
}
HEADINGS = {False: "each robot decides by itself; it uses", True: "a centre decides; it uses"}
LEGEND = """\
broadcasts: robots may transmit in both halves of a window, to all who hear; nobody answers.
request: a robot addresses a teammate in the first half, which answers in the second.
T, M, P: all that the sender knows of its teammates: when it was seen, its state, who passed it on.
snapshots: two pictures of the whole team, on which robots agree to plan alike.
links: how often robots decoded and missed each other, and what that says of the channel.
p: the probability of a transmission, unless you give --probability.
Bytes and probabilities here are those for"""


@dataclass(frozen=True, kw_only=True)
class PoliciesOptions:
    """The options of `swarm-mj policies`."""

    EPILOG: ClassVar = "Probabilities and bytes depend on the mission, so the options may name one."
    name: str | None = setting(
        None,
        "say more of this one: a policy, where a learned one is, or module:Name of your own",
        is_positional=True,
        metavar="NAME",
        convert=normalised,
    )
    json: bool = setting(False, "print JSON in place of the table")
    mission: Mission = one_mission()


def run(options: PoliciesOptions) -> int:
    """Run the command; return its exit code."""
    mission, names = options.mission, [options.name]
    if options.name is None:
        flown = dict.fromkeys(flown_name(name, mission) for name in POLICIES)
        names = [name for name in flown if name != SHIPPED or is_installed("torch")]
        if len(names) < len(flown):
            plain_console(is_error=True).print(missing("torch", f"{SHIPPED} is left out: it"))
    with Console(stderr=True).status("Loading ..."):
        facts = [facts_of(name, make_policy(name, mission), mission) for name in names if name]
    if options.json:
        sys.stdout.write(json.dumps(facts if options.name is None else facts[0], indent=2) + "\n")
    elif options.name is None:
        _print_all(facts, mission)
    else:
        _print_one(facts[0], mission)
    return DONE


def facts_of(name: str, policy: Policy, mission: Mission) -> dict[str, Any]:
    """Return a policy's description of itself, as `--json` has it."""
    kind, packet = type(policy), policy.packet(mission)
    entries = [times(field, packet.num_entries) for field in packet.entry]
    return {
        "name": name,
        "is_centralised": policy.is_centralised,
        "window": "broadcasts" if policy.window(mission).is_broadcast else "request",
        "uses": policy.uses,
        "payload": policy.payload,
        "packet_bytes": packet.num_bytes,
        "packet_fields": [
            {"name": field.name, "bits": field.bits, "count": field.count}
            | ({"step": field.step, "unit": field.unit} if field.unit else {})
            for field in (*packet.header, *entries, *packet.payload)
        ],
        "probability": policy.parameters.get("probability"),
        "parameters": dict(policy.parameters),
        "class": f"{kind.__module__}.{kind.__qualname__}",
        "description": inspect.getdoc(kind) or "",
    }


def _print_all(facts: list[dict[str, Any]], mission: Mission) -> None:
    """Print a table of the policies that decide alike, then what its words mean."""
    console = Console(highlight=False)
    for is_centralised, heading in HEADINGS.items():
        table = Table("policy", heading, "packets\ncarry", "window", show_lines=True)
        for each in (each for each in facts if each["is_centralised"] == is_centralised):
            name, p = each["name"].replace(" --", "\n  --"), each["probability"]
            name += "" if p is None else f"\n  p = {as_typed(p)}"
            carried = "\n".join((*_carried(each), f"{each['packet_bytes']:,} bytes"))
            table.add_row(name, each["uses"], carried, each["window"])
        console.print(table)
    more = f"\nMore of one:  {this_command()} policies NAME"
    plain_console().print(f"{LEGEND} {_described(mission)}.\n{more}")


def _print_one(each: dict[str, Any], mission: Mission) -> None:
    rows = {
        "who decides": "a centre" if each["is_centralised"] else "each robot by itself",
        "what it uses": each["uses"] or "it does not say: give its class a text `uses`",
        "in a window": WINDOWS[each["window"]],
        "packets carry": ", ".join(_carried(each)),
        "packet": f"{each['packet_bytes']:,} bytes",
        **{name: as_typed(value) for name, value in each["parameters"].items()},
        "source": each["class"],
    }
    if each["probability"] is not None:
        rows["probability"] += f", tuned for {_described(mission)}"
    right = [Column(name, justify="right") for name in ("bits", "numbers", "step")]
    packet = Table("field", *right, title="a packet", title_justify="left")
    for field in each["packet_fields"]:
        step = f"{field['step']:.3g} {field['unit']}" if "step" in field else ""
        packet.add_row(field["name"], str(field["bits"]), f"{field['count']:,}", step)
    Console(highlight=False).print(named_values(each["name"], rows), packet)
    policy = each["name"] if each["name"] in POLICIES else shlex.quote(each["name"])
    fly = f"{this_command()} fly --policy {policy} {mission_flags(mission)}"
    plain_console().print(f"{each['description']}\n\nFly it:  {fly}")


def _carried(each: dict[str, Any]) -> tuple[str, ...]:
    return ("T, M, P",) if each["payload"] == "none" else ("T, M, P", each["payload"])


def _described(mission: Mission) -> str:
    return f"{mission.task}, {mission.num_robots} robots, range ratio {mission.range_ratio:g}"
