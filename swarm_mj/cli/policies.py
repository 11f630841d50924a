"""`swarm-mj policies`: policies, a line each; of one, what it knows and sends."""

import json
import shlex
import sys
from dataclasses import dataclass
from typing import Any, ClassVar

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Column, Table

from swarm_mj.api.policy_facts import BROADCASTS, REQUEST, carried, facts_of
from swarm_mj.cli.mission_options import mission_flags, one_mission
from swarm_mj.mission import Mission
from swarm_mj.policies.policy import Policy
from swarm_mj.policies.registry import (
    POLICIES,
    SHIPPED,
    flown_name,
    is_own_policy,
    make_policy,
    note_on,
)
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import as_typed, common_setting, setting
from swarm_mj.system.packages import is_installed, missing
from swarm_mj.system.terminal import named_values, plain_console, this_command

HEADINGS = {False: "each robot decides by itself", True: "a centre decides"}
WINDOWS = {
    BROADCASTS: "two broadcasts, which nobody answers",
    REQUEST: "a request to a teammate, which answers",
}
T_M_P = "T, M, P: when each teammate was seen, its state, and who passed that on"


@dataclass(frozen=True, kw_only=True)
class PoliciesOptions:
    """The options of `swarm-mj policies`."""

    EPILOG: ClassVar = "Probabilities and bytes depend on the mission, so the options may name one."
    name: str | None = setting(
        None,
        "say more of this one: a policy, where a learned one is, or module:Name of your own",
        is_positional=True,
        metavar="NAME",
    )
    json: bool = common_setting(False, "print JSON in place of the table")
    mission: Mission = one_mission()


def run(options: PoliciesOptions) -> int:
    """Run the command; return its exit code."""
    mission = options.mission
    if options.name is not None:
        names = [options.name]
    else:
        flown = dict.fromkeys(flown_name(name, mission) for name in POLICIES)
        names = [name for name in flown if name != SHIPPED or is_installed("torch")]
        if len(names) < len(flown):
            plain_console(is_error=True).print(missing("torch", f"{SHIPPED} is left out: it"))
    with Console(stderr=True).status("Loading ..."):
        policies = {name: make_policy(name, mission) for name in names}
        facts = [facts_of(name, policy, mission) for name, policy in policies.items()]
    if options.json:
        sys.stdout.write(json.dumps(facts if options.name is None else facts[0], indent=2) + "\n")
    elif options.name is None:
        _print_all(facts, mission)
    else:
        _print_one(facts[0], policies[options.name], mission)
    return DONE


def _print_all(facts: list[dict[str, Any]], mission: Mission) -> None:
    """Print a line of each policy: those whose robots decide, then those of a centre."""
    console = Console(highlight=False)
    for is_centralised, heading in HEADINGS.items():
        columns = [Column(head, no_wrap=True) for head in ("policy", heading)]
        table = Table(*columns, box=SIMPLE_HEAD, show_edge=False, pad_edge=False)
        table.add_column("packets", justify="right")
        for each in facts:
            if each["is_centralised"] != is_centralised:
                continue
            does = each["description"].partition("\n")[0].removesuffix(".")
            table.add_row(each["name"], does, f"{each['packet_bytes']:,} B")
        console.print(table, "")
    more = f"What one knows and sends:  {this_command()} policies NAME"
    plain_console().print(f"Packets are those for {_described(mission)}.\n{more}")


def _print_one(each: dict[str, Any], policy: Policy, mission: Mission) -> None:
    rows = {
        "decentralised": "no" if each["is_centralised"] else "yes",
        "what it uses": each["uses"] or "it does not say: give its class a text `uses`",
        **_beyond_paper(each),
        "in a window": WINDOWS[each["window"]],
        "packets carry": f"{T_M_P}\n{carried(policy)}" if policy.carries_more else T_M_P,
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
    typed = each["name"] if each["name"] in POLICIES else shlex.quote(each["name"])
    fly = f"{this_command()} fly --policy {typed} {mission_flags(mission)}"
    note = note_on(each["name"], mission)
    said = f"{each['description']}\n\n{note}." if note else each["description"]
    plain_console().print(f"{said}\n\nFly it:  {fly}")


def _beyond_paper(each: dict[str, Any]) -> dict[str, str]:
    """Return the row of what a policy uses beyond the paper; a stored network's has none."""
    row = "beyond the paper"
    beyond = each["beyond_paper"]
    if beyond is not None:
        return {row: ", ".join(beyond) or "nothing"}
    if is_own_policy(each["name"]):
        return {row: "it does not say: give its class an `about`"}
    return {}


def _described(mission: Mission) -> str:
    return f"{mission.task}, {mission.num_robots} robots, range ratio {mission.range_ratio:g}"
