"""The numbers in the README and the docs, written from the results between their markers.

    python tools/results_table.py            # writes them
    python tools/results_table.py --check    # says which differ, and writes nothing

A table stands between `<!-- table: NAME -->` and `<!-- end -->`; `tables.toml` says what it shows.
A number in a sentence stands between `<!-- value: RESULTS key=value ... {field:.1f} -->` and
`<!-- end -->`: the field of the one row with these keys in `training/results/RESULTS.csv`.
"""

import re
import shlex
import sys
import tomllib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from results_rows import Row, Rows, origin, read, select

from swarm_mj.api.policy_facts import facts_of
from swarm_mj.cli import script
from swarm_mj.evaluation.markdown_table import markdown_table
from swarm_mj.evaluation.results import LARGER_PACKETS
from swarm_mj.mission import paper
from swarm_mj.policies.about import NO_PAYLOAD
from swarm_mj.policies.registry import POLICIES, make_policy
from swarm_mj.system.exit_codes import DONE, FAILED
from swarm_mj.system.fields import setting
from swarm_mj.system.writing import write_text

ROOT = Path(__file__).resolve().parent.parent
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
TABLES: dict[str, Any] = tomllib.loads(Path(__file__).with_name("tables.toml").read_text("utf-8"))
NAMES: dict[str, str] = TABLES.pop("names")  # of policies, where a table does not show the policy's
MARKER = re.compile(r"<!-- (table|value): (.*?) -->(.*?)<!-- end -->", re.DOTALL)
AGE = "{aoi_mean:.1f} ± {aoi_sem:.1f}"
PUBLISHED = (
    " ({{published_{0}_mean:{1}}} ± {{published_{0}_sem:{1}}})"  # after what it is compared to
)
COSTS = (("aoi", ".1f"), ("velocity_variance", ".3f"))  # that the paper published, and their digits
FACTS = ("payload", "uses", "beyond_paper")  # that a row may say itself
OF_TABLES = ("function", "results", "where", "head", "columns", "rows", "more", "order", "form")
OWN = ("head", "results", "form", "fact", *FACTS)  # keys of a row or a column that no result has
sys.path.append(str(ROOT / "training"))  # where the modules are that make tables


def table(spec: dict[str, Any], folder: Path) -> str:
    """Return a table as Markdown, with the origin of its numbers below.

    Raises ValueError if a cell could be one of several results, or there is nothing to show.
    """
    unknown = spec.keys() - set(OF_TABLES)
    if unknown:
        known = ", ".join(OF_TABLES)
        raise ValueError(f"a table has no {', '.join(sorted(unknown))}; it has {known}")
    if function := spec.get("function"):
        return _made(function, _sources(spec), folder)
    columns = _listed(spec["columns"])
    rows = [_row(each) for each in spec.get("rows", ())] or _by_age(spec, columns, folder)
    rows += spec.get("more", ())
    used: Rows = []
    cells = [[_cell(spec, row, column, folder, used) for column in columns] for row in rows]
    head = [spec.get("head", "policy"), *(column["head"] for column in columns)]
    lines = [[_name(row, used), *its] for row, its in zip(rows, cells, strict=True)]
    if not used:
        raise ValueError(f"the table of {', '.join(_sources(spec, {}, {}))} has no numbers")
    return f"{markdown_table(head, lines)}\n\n{origin(used)}"


def _made(function: str, sources: Sequence[str], folder: Path) -> str:
    """Return the table of a function, with the origin of the results that it shows."""
    module, _, name = function.partition(":")
    made = getattr(import_module(module), name)(folder)
    return f"{made}\n\n{origin(read(sources, folder))}" if sources else made


def _listed(columns: list[dict[str, Any]] | dict[str, Any]) -> list[dict[str, Any]]:
    """Return columns of a list, or those of one field's values."""
    if isinstance(columns, list):
        return columns
    [(field, values)] = columns.items()
    return [{"head": f"{x:g}" if isinstance(x, float) else str(x), field: x} for x in values]


def _row(row: str | dict[str, Any]) -> dict[str, Any]:
    return {"policy": row} if isinstance(row, str) else row


def _sources(*parts: dict[str, Any]) -> list[str]:
    """Return the names of the results that a cell is looked up in: those of the last that has."""
    [*_, found] = [part["results"] for part in parts if "results" in part] or [()]
    return [found] if isinstance(found, str) else list(found)


def _by_age(spec: dict[str, Any], columns: Sequence[dict[str, Any]], folder: Path) -> list[Any]:
    """Return a row for each policy found, the lowest mean over the columns first.

    Of a table with results of its own, these have its policies; columns of others may have more.
    """
    its_own = {row["policy"] for row in read(_sources(spec), folder)}
    found: Rows = []
    for column in columns:
        rows = read(_sources(spec, column), folder)
        where = spec.get("where", {}) | _keys(column)
        _check_keys(where, rows)
        found += select(rows, where)
    ages: dict[str, list[float]] = {}
    for row in found:
        if its_own and row["policy"] not in its_own:
            continue
        ages.setdefault(row["policy"], []).append(row[spec.get("order", "aoi_mean")])
    return [{"policy": name} for name in sorted(ages, key=lambda n: sum(ages[n]) / len(ages[n]))]


def _keys(part: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in part.items() if name not in OWN}


def _cell(
    spec: dict[str, Any], row: dict[str, Any], column: dict[str, Any], folder: Path, used: Rows
) -> str:
    """Return a cell; note the result that it shows."""
    if fact := column.get("fact"):
        return row.get(fact) or _fact(row["policy"], fact)
    where = spec.get("where", {}) | _keys(column) | _keys(row)
    if where != where | _keys(column):
        raise ValueError(
            f"the row {row} contradicts its column {column}: one number would fill all"
        )
    rows = read(_sources(spec, column, row), folder)
    _check_keys(where, rows)
    found = select(rows, where)
    if len(found) > 1:
        raise ValueError(f"{len(found)} results have {where}; name what tells them apart")
    used += found
    form = row.get("form") or column.get("form") or spec.get("form", AGE)
    beside = [PUBLISHED.format(*cost) for cost in COSTS if form.startswith(f"{{{cost[0]}_mean:")]
    return "".join(shown(each, part) for each in found for part in (form, *beside))


def _check_keys(where: Row, rows: Rows) -> None:
    """Raise ValueError for a key that no result has: its cell would be empty in silence."""
    known = {"figure"}  # which the paper's points have, and no results
    for row in rows:
        known |= row.keys()
    unknown = where.keys() - known
    if rows and unknown:
        raise ValueError(f"no result has a column {', '.join(sorted(unknown))}; name one of theirs")


def shown(row: Row, form: str) -> str:
    """Return a result in a form, without what begins at a field that it does not have."""
    text = ""
    for part in re.split(r"(?= ± )", form):
        try:
            text += part.format(**row)
        except (TypeError, KeyError):
            break
    return text


def _fact(policy: str, fact: str) -> str:
    """Return what a policy says of itself."""
    mission = paper("random-walk")
    said = facts_of(policy, make_policy(policy, mission), mission)[fact]
    text = ", ".join(said) if isinstance(said, list | tuple) else str(said)
    return "nothing" if text in (NO_PAYLOAD, "") else text


def _name(row: dict[str, Any], used: Rows) -> str:
    if head := row.get("head"):
        return head
    flown = [each for each in used if each["policy"] == row["policy"]]
    more = any(each.get("payload") not in (None, NO_PAYLOAD) for each in flown)
    policy = str(row["policy"])
    own = f"`{policy}`" if policy.partition(" ")[0] in POLICIES else policy
    name = NAMES.get(policy, own)
    return f"{name} ({LARGER_PACKETS})" if more else name


def value(words: str, folder: Path) -> str:
    """Return a number of a sentence, given what its marker says; ValueError if it is not one."""
    source, *keys, form = shlex.split(words)
    where = dict(key.split("=", 1) for key in keys)
    found = select(read([source], folder), where)
    if len(found) != 1:
        raise ValueError(f"{len(found)} results of {source} have {where}, not 1: {words}")
    if not (number := shown(found[0], form)):
        raise ValueError(f"{source} has no such number: {words}")
    return number


def filled(text: str, folder: Path) -> str:
    """Return a page with its numbers as the results have them."""

    def fill(match: re.Match[str]) -> str:
        kind, what, before = match.groups()
        if kind == "table":
            if what not in TABLES:
                raise ValueError(f"tables.toml has no table {what}")
            now = f"\n\n{table(TABLES[what], folder)}\n\n"
        else:
            now = value(what, folder)
        return f"<!-- {kind}: {what} -->{now}<!-- end -->" if now != before else match.group()

    return MARKER.sub(fill, text)


def numbers(pages: Iterable[Path], folder: Path) -> dict[Path, str]:
    """Return the pages whose numbers differ from the results, as they should be."""
    texts = {page: page.read_text("utf-8") for page in pages}
    now = {page: _named(page.name, partial(filled, text, folder)) for page, text in texts.items()}
    return {page: text for page, text in now.items() if text != texts[page]}


def _named(name: str, make: Callable[[], str]) -> str:
    """Return what is made; an error names the page or the table."""
    try:
        return make()
    except (ValueError, KeyError, OSError, ImportError, AttributeError) as error:
        raise ValueError(f"{name}: {error}") from error


@dataclass(frozen=True, kw_only=True)
class Options:
    """Where the numbers come from, and whether they are written."""

    results: Path = setting(
        ROOT / "training" / "results", "where they are", metavar="DIR", shown="training/results"
    )
    check: bool = setting(False, "write nothing; fail if a page differs")
    structure: bool = setting(False, "write nothing; fail if a table or number cannot be made")


def run(options: Options) -> int:
    """Write the pages, or check them; return the exit code."""
    changed = numbers(PAGES, options.results)
    if options.structure:
        for name, spec in TABLES.items():
            _named(name, partial(table, spec, options.results))
        print(f"All {len(TABLES)} tables of the docs can be made from {options.results}")
        return DONE
    for page, text in changed.items():
        print(f"{page.relative_to(ROOT)} {'differs' if options.check else 'is written'}")
        if not options.check:
            write_text(page, text)
    return FAILED if options.check and changed else DONE


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the tool; return its exit code."""
    return script(Options, run, arguments)


if __name__ == "__main__":
    sys.exit(main())
