"""The table of what each policy uses beyond the paper's information, as Markdown for a page.

It is made from what policies declare, as `swarm-mj policies NAME` says it.
"""

from collections.abc import Iterator
from pathlib import Path

from swarm_mj.evaluation.markdown_table import markdown_table
from swarm_mj.mission import paper
from swarm_mj.policies.about import About, Information
from swarm_mj.policies.registry import LISTED, SHIPPED, WITHOUT_PAYLOAD, make_policy

POSITIONS = "positions"  # the one column of both kinds of positions
MARKS = {Information.OBSERVED_POSITIONS: "noisy", Information.TRUE_POSITIONS: "true"}


def table(_folder: Path | None = None) -> str:
    """Return the table, policies by kinds, and below it a list of the kinds in a sentence each.

    No result is in it, whatever the folder of the results.
    """
    columns = list(dict.fromkeys(_column(kind) for kind in Information))
    rows: list[list[str]] = []
    for row, about in _rows():
        marks = {_column(kind): MARKS.get(kind, "yes") for kind in about.beyond}
        cells = [marks.get(column, "") for column in columns]
        rows.append([row, *cells])
    sentences = [f"- **{_label(kind)}**: {kind.sentence}" for kind in Information]
    return "\n".join([markdown_table(["policy", *columns], rows), "", *sentences])


def _rows() -> Iterator[tuple[str, About]]:
    """Yield what each row is called, and what its policy says of itself."""
    for name, about in LISTED.items():
        if name == "planner":
            yield f"`{SHIPPED}`", LISTED[SHIPPED]  # beside what it is compared with
            yield "`planner`, moving", about
            at_rest = make_policy(name, paper("stationary")).about
            assert at_rest is not None
            yield "`planner`, at rest", at_rest
        elif name == WITHOUT_PAYLOAD:
            yield f"`{name}`, at rest", about
        elif name != SHIPPED:
            yield f"`{name}`", about


def _column(kind: Information) -> str:
    return POSITIONS if kind in MARKS else kind.label


def _label(kind: Information) -> str:
    return f"{kind.label} ({MARKS[kind]})" if kind in MARKS else kind.label
