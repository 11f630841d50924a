"""Where a thing is declared, as `file:line`, for what a test says when it fails."""

import inspect
import re
from pathlib import Path

import swarm_mj

ROOT = Path(swarm_mj.__file__).parents[1]


def where_class(kind):
    """The line on which a class begins, after its decorators."""
    return where_text(inspect.getfile(kind), rf"^class {kind.__name__}\b")


def where_field(kind, name):
    """The line on which a class, or the base that it has the field from, declares a field."""
    owner = next(each for each in kind.__mro__ if name in inspect.get_annotations(each))
    return where_text(inspect.getfile(owner), rf"^    {name}: ")


def where_text(file, pattern):
    """The first line of a file that a pattern is found on; the file alone if there is none."""
    path = Path(file).relative_to(ROOT)
    for number, line in enumerate(Path(file).read_text().splitlines(), start=1):
        if re.search(pattern, line):
            return f"{path}:{number}"
    return f"{path}"
