"""`swarm-mj policies`: who talks when, what each policy knows, what its packets carry."""

import inspect
import json
import shlex
import sys
from dataclasses import dataclass
from typing import Any, ClassVar

from rich.console import Console
from rich.table import Table

from swarm_mj.cli.mission_options import mission_flags, one_mission
from swarm_mj.mission import Mission
from swarm_mj.policies.policy import CentralisedPolicy, Policy
from swarm_mj.policies.registry import POLICIES, SHIPPED, flown_name, make_policy, normalised
from swarm_mj.protocol.packets import Packet, times
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
T, M, P: all that the sender knows of its teammates: when it was seen, the state, who told it.
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
    """Run the command; returns its exit code."""
    if options.name is None:
        flown = dict.fromkeys(flown_name(name, options.mission) for name in POLICIES)
        names = [name for name in flown if _can_be_made(name)]
    else:
        names = [options.name]
    with Console(stderr=True).status("Loading ..."):
        made = {name: make_policy(name, options.mission) for name in names}
    facts = [facts_of(name, policy, options.mission) for name, policy in made.items()]
    if options.json:
        sys.stdout.write(json.dumps(facts if options.name is None else facts[0], indent=2) + "\n")
    elif options.name is None:
        _print_all(facts, options.mission)
    else:
        _print_one(facts[0], options.mission)
    return DONE


def facts_of(name: str, policy: Policy, mission: Mission) -> dict[str, Any]:
    """What a policy says of itself, as `--json` has it."""
    kind = type(policy)
    is_broadcast = policy.window(mission).is_broadcast
    return {
        "name": name,
        "is_centralised": isinstance(policy, CentralisedPolicy),
        "window": "broadcasts" if is_broadcast else "request",
        "uses": policy.uses,
        "payload": policy.payload,
        "packet_bytes": policy.packet(mission).num_bytes,
        "packet_fields": _fields(policy.packet(mission)),
        "probability": policy.parameters.get("probability"),
        "parameters": dict(policy.parameters),
        "class": f"{kind.__module__}.{kind.__qualname__}",
        "description": inspect.getdoc(kind) or "",
    }


def _print_all(facts: list[dict[str, Any]], mission: Mission) -> None:
    console = Console(highlight=False)
    for is_centralised, heading in HEADINGS.items():
        table = Table(show_lines=True)
        for column in ("policy", heading, "packets\ncarry", "window"):
            table.add_column(column)
        for each in facts:
            if each["is_centralised"] == is_centralised:
                table.add_row(*_cells(each))
        console.print(table)
    plain = plain_console()
    plain.print(f"{LEGEND} {_described(mission)}.")
    plain.print(f"\nMore of one:  {this_command()} policies NAME")


def _cells(each: dict[str, Any]) -> tuple[str, ...]:
    probability = each["probability"]
    name = each["name"].replace(" --", "\n  --")
    name += "" if probability is None else f"\n  p = {as_typed(probability)}"
    carried = [*_carried(each["payload"]), f"{each['packet_bytes']:,} bytes"]
    return name, each["uses"], "\n".join(carried), each["window"]


def _fields(packet: Packet) -> list[dict[str, Any]]:
    """Return a packet's table of fields: how wide, how many, and how far apart two numbers are."""
    entries = [times(field, packet.num_entries) for field in packet.entry]
    return [
        {"name": field.name, "bits": field.bits, "count": field.count}
        | ({"step": field.step, "unit": field.unit} if field.unit else {})
        for field in (*packet.header, *entries, *packet.payload)
    ]


def _packet_table(fields: list[dict[str, Any]]) -> Table:
    table = Table(title="a packet", title_justify="left")
    table.add_column("field")
    for column in ("bits", "numbers", "step"):
        table.add_column(column, justify="right")
    for each in fields:
        step = f"{each['step']:.3g} {each['unit']}" if "step" in each else ""
        table.add_row(each["name"], str(each["bits"]), f"{each['count']:,}", step)
    return table


def _can_be_made(name: str) -> bool:
    """Whether a policy's library is installed; says so if it is not."""
    if name != SHIPPED or is_installed("torch"):
        return True
    plain_console(is_error=True).print(missing("torch", f"{name} is left out: it"))
    return False


def _carried(payload: str) -> tuple[str, ...]:
    return ("T, M, P",) if payload == "none" else ("T, M, P", payload)


def _print_one(each: dict[str, Any], mission: Mission) -> None:
    """All of one policy, and how to fly it."""
    rows = {
        "who decides": "a centre" if each["is_centralised"] else "each robot by itself",
        "what it uses": each["uses"] or "it does not say: give its class a text `uses`",
        "in a window": WINDOWS[each["window"]],
        "packets carry": ", ".join(_carried(each["payload"])),
        "packet": f"{each['packet_bytes']:,} bytes",
        **{name: as_typed(value) for name, value in each["parameters"].items()},
        "source": each["class"],
    }
    if each["probability"] is not None:
        rows["probability"] += f", tuned for {_described(mission)}"
    shown = Console(highlight=False)
    shown.print(named_values(each["name"], rows))
    shown.print(_packet_table(each["packet_fields"]))
    console = plain_console()
    console.print(each["description"])
    policy = each["name"] if each["name"] in POLICIES else shlex.quote(each["name"])
    console.print(f"\nFly it:  {this_command()} fly --policy {policy} {mission_flags(mission)}")


def _described(mission: Mission) -> str:
    return f"{mission.task}, {mission.num_robots} robots, range ratio {mission.range_ratio:g}"
