"""The words of the project: the field's terms, and plain English."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# Each with a better one: predict, compute, assume; a robot that; the robot that; is given; this
# many, as many as; your own, its own; reasonable; slot table; none.
REFUSED = re.compile(
    r"\b(reckon\w*|whoever|hearsay|worth a thought|so many|told|as it were|of one's own"
    r"|nobody's)\b",
    re.IGNORECASE,
)
HISTORY = {"CHANGELOG.md", "RESULTS.md", "claims.md"}  # what was, in the words of its time


def pages():
    """Everything that a user or a reader of the code reads."""
    for pattern in ("swarm_mj/**/*.py", "tools/*.py", "training/*.py", "docs/**/*.md", "*.md"):
        yield from (path for path in ROOT.glob(pattern) if path.name not in HISTORY)


def test_words_that_no_engineer_would_use_are_refused():
    found = [
        f"{path.relative_to(ROOT)}:{number}: {match[0]}"
        for path in pages()
        for number, line in enumerate(path.read_text().splitlines(), start=1)
        for match in [REFUSED.search(line)]
        if match
    ]
    assert not found, "\n".join(found)


def docstrings(path):
    """The docstrings of a file's modules, classes and functions."""
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef)
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, kinds) and (text := ast.get_docstring(node)):
            yield text


ROOMS = sorted(path.parent.name for path in (ROOT / "swarm_mj").glob("*/__init__.py"))


@pytest.mark.parametrize("room", ROOMS)
def test_docstrings_say_what_a_thing_is_or_does(room):
    """They begin with a verb or a noun phrase, not with a relative clause."""
    opening = re.compile(r"(What|Whether|Of|Whose|Whom)\b")
    found = [
        f"{path.name}: {text.splitlines()[0]}"
        for path in (ROOT / "swarm_mj" / room).rglob("*.py")
        for text in docstrings(path)
        if opening.match(text)
    ]
    assert not found, "\n".join(found)
