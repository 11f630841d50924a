"""The list of policies in the docs: what each knows and sends, as `swarm-mj policies` says it."""

import re
from pathlib import Path
from typing import Any

from swarm_mj.api.policy_facts import carried, facts_of
from swarm_mj.evaluation.markdown_table import markdown_table
from swarm_mj.mission import Task, paper
from swarm_mj.policies.policy import Policy
from swarm_mj.policies.registry import POLICIES, WITHOUT_PAYLOAD, make_policy

HEADS = ("policy", "window", "what each robot uses", "packets carry beyond T, M, P", "bytes")
WINDOWS = {"broadcasts": "two broadcasts", "request": "request, response"}
_NAMES = "|".join(sorted(POLICIES, key=len, reverse=True))
CODE = re.compile(rf"(?<![\w-])({_NAMES}|--preset \w+)(?![\w-])")
NUM_ROBOTS = 40


def table(_folder: Path, /) -> str:
    """Return the list as Markdown; no results are in it."""
    rows = [_row(name, task, when) for name in POLICIES for task, when in _tasks(name)]
    shown = markdown_table(HEADS, rows, right_from=4)
    return f"{shown}\n\n*Bytes a packet in teams of {NUM_ROBOTS}, as `swarm-mj policies` has them.*"


def _tasks(name: str) -> tuple[tuple[Task, str], ...]:
    """Return the tasks in which a policy differs, and what to call them."""
    if name == "planner":
        return ("stationary", ", at rest"), ("random-walk", ", moving")
    if name == WITHOUT_PAYLOAD:
        return (("stationary", ""),)  # elsewhere it is another policy
    return (("random-walk", ""),)


def _row(name: str, task: Task, when: str) -> tuple[str, ...]:
    mission = paper(task, num_robots=NUM_ROBOTS)
    policy = make_policy(name, mission)
    facts = facts_of(name, policy, mission)
    return (
        f"`{name}`{when}",
        WINDOWS[facts["window"]],
        _used(facts),
        _carried(policy),
        f"{facts['packet_bytes']:,}",
    )


def _used(facts: dict[str, Any]) -> str:
    text = CODE.sub(r"`\1`", facts["uses"])
    return f"*centralised:* {text}" if facts["is_centralised"] else text


def _carried(policy: Policy) -> str:
    return carried(policy) if policy.carries_more else "nothing"
