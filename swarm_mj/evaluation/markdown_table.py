"""Tables as Markdown, for documentation that is written from results."""

from collections.abc import Sequence


def markdown_table(
    head: Sequence[str], rows: Sequence[Sequence[str]], *, right_from: int | None = None
) -> str:
    """Return a table as Markdown.

    Args:
        head: What stands above the columns.
        rows: As many cells each.
        right_from: The first column whose cells are aligned to the right, as are all after it.

    Raises:
        ValueError: A row has another number of cells.
    """
    rules = ["---"] * len(head)
    if right_from is not None:
        rules[right_from:] = ["---:"] * len(rules[right_from:])
    lines = []
    for cells in (head, rules, *rows):
        if len(cells) != len(head):
            raise ValueError(f"a row has {len(cells)} cells, not {len(head)} as the head: {cells}")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)
