"""The table of what each policy uses beyond the paper's information, as Markdown for a page.

It is made from `swarm_mj/policies/uses.toml`, where `swarm-mj policies NAME` has it from, too.
"""

from swarm_mj.policies.registry import BEYOND, KINDS

POSITIONS = "positions"  # the one column of both kinds of positions
MARKS = {"positions as observed": "noisy", "true positions": "true"}
# Rows of a policy that has several entries, or none under the name by which it is flown.
ROWS = {
    "planner, snapshots": "`planner`, moving",
    "planner, links": "`planner`, at rest",
    "planner": "`planner --payload none`, at rest",
}


def table() -> str:
    """Return the table, policies by kinds, and below it a list of the kinds in a sentence each."""
    columns = list(dict.fromkeys(POSITIONS if kind in MARKS else kind for kind in KINDS))
    rows = [["policy", *columns], ["---"] * (len(columns) + 1)]
    for policy, kinds in BEYOND.items():
        marks = {POSITIONS if kind in MARKS else kind: MARKS.get(kind, "yes") for kind in kinds}
        cells = [marks.get(column, "") for column in columns]
        rows.append([ROWS.get(policy, f"`{policy}`"), *cells])
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([*lines, "", *(f"- **{_label(kind)}**: {KINDS[kind]}" for kind in KINDS)])


def _label(kind: str) -> str:
    return f"{kind} ({MARKS[kind]})" if kind in MARKS else kind
