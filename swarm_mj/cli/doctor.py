"""`swarm-mj doctor`: what is installed, what works on this machine, how to mend what does not."""

import json
import sys
from dataclasses import dataclass
from itertools import groupby
from typing import ClassVar

from rich.console import Console
from rich.table import Table

from swarm_mj.cli.health.finding import Finding
from swarm_mj.cli.health.machine import machine
from swarm_mj.cli.health.packages import about, packages
from swarm_mj.cli.health.trials import tried
from swarm_mj.system.exit_codes import DONE, FAILED
from swarm_mj.system.fields import setting
from swarm_mj.system.terminal import plain_console

MARKS = {"ok": "ok", "absent": "-", "broken": "BROKEN"}
VERDICTS = {
    True: "swarm_mj works here.",
    False: "swarm_mj does not work here until what is BROKEN is mended.",
}


@dataclass(frozen=True, kw_only=True)
class DoctorOptions:
    """The options of `swarm-mj doctor`."""

    EPILOG: ClassVar = "Exit codes: 0 swarm_mj works, 1 something that it needs is broken."
    json: bool = setting(False, "print JSON in place of the table")


def run(options: DoctorOptions) -> int:
    """Run the command; returns its exit code."""
    with Console(stderr=True).status("Trying things out ..."):
        found = [*about(), *packages(), *tried(), *machine()]
    is_sound = all(each.state != "broken" for each in found)
    if options.json:
        findings = [each._asdict() for each in found]
        document = {"works": is_sound, "findings": findings}
        sys.stdout.write(json.dumps(document, indent=2) + "\n")
    else:
        _print(found, VERDICTS[is_sound])
    return DONE if is_sound else FAILED


def _print(found: list[Finding], verdict: str) -> None:
    """Return a table by groups, then what to do, then whether it works."""
    groups = list(dict.fromkeys(each.group for each in found))
    in_groups = sorted(found, key=lambda each: groups.index(each.group))
    table = Table(show_header=False)
    for _ in Finding._fields[1:4]:
        table.add_column(overflow="fold")
    for group, findings in groupby(in_groups, lambda each: each.group):
        table.add_row(f"[bold]{group}[/bold]")
        for each in findings:
            table.add_row(f"  {each.name}", MARKS[each.state], each.found)
        table.add_section()
    Console(highlight=False, markup=True).print(table)
    console = plain_console()
    lacking = [each for each in in_groups if each.state != "ok"]
    if lacking:
        console.print("What to do, if you need it:")
    for each in lacking:
        console.print(f"  {each.name}: {each.mend}")
    console.print(verdict)
