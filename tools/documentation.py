"""What the documentation's site has beside the pages in `docs/`; `mkdocs.yml` names it as a hook.

Pages and links are written for readers of the repository. The site's home is the README, and where
a page links to another file of the repository, the site gets that file, too.
"""

import os
import posixpath
import re
from dataclasses import fields
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from notebook_page import page_of

import swarm_mj
from swarm_mj.mission import Mission
from swarm_mj.physics.arenas import ARENAS
from swarm_mj.system.fields import as_typed, meaning_of, range_of

ROOT = Path(__file__).parent.parent
PAGES = {  # where they are on the site, and in the repository
    "overview.md": "README.md",
    "changelog.md": "CHANGELOG.md",
    "contributing.md": "CONTRIBUTING.md",
}
PLACES = {source: page for page, source in PAGES.items()}
LINK = re.compile(r"(\]\(|src=\"|srcset=\")(?![a-z]+:|#)([^)#\"\s]+)")
FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
MAP_LINE = re.compile(
    r"^    ([IV]\S*)\s+((?:Eq|Alg|Fig)\. \d+)?\s+(\S.*?)\s{2,}(\S+)$", re.MULTILINE
)


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Add what stands elsewhere, and turns links between files into links of the site.

    Args:
        files: Those of `docs/`.
        config: The site's.

    Returns:
        The same files and more.

    Raises:
        FileNotFoundError: A page links to what is not in the repository.
    """
    written = {page: (ROOT / source).read_text("utf-8") for page, source in PAGES.items()}
    written["paper-map.md"] = paper_map()
    written["tour.md"] = page_of(ROOT / "docs/tour.ipynb")
    for file in files.documentation_pages():
        written[file.src_uri] = file.content_string
    brought: set[str] = set()
    for page, text in written.items():
        source = PAGES.get(page, f"docs/{page}")  # where its links start
        text = text.replace("<!-- fields of Mission -->", mission_fields())
        linked, targets = site_links(text, source, page)
        brought |= targets
        _put(files, File.generated(config, page, content=linked))
    for target in sorted(brought):
        if target.endswith(".py"):
            code = f"# `{target}`\n\n```python\n{(ROOT / target).read_text('utf-8')}```\n"
            _put(files, File.generated(config, place_of(target), content=code))
        else:
            _put(files, File.generated(config, place_of(target), abs_src_path=str(ROOT / target)))
    return files


def mission_fields() -> str:
    """Return the fields of `Mission` as a table."""
    rows = ["| field | default | what it is | allowed | source |", "|---|---|---|---|---|"]
    for spec in fields(Mission):
        about = meaning_of(spec)
        if about.choices:
            allowed = ", ".join(f"`{choice}`" for choice in about.choices)
        elif about.has_range:
            allowed = range_of(spec)
        elif spec.name == "arena":
            allowed = ", ".join(f"`{arena}`" for arena in ARENAS) + ", or an MJCF file"
        else:
            allowed = "`True`, `False`"
        meaning = about.help or about.label or spec.name.replace("_", " ")
        cells = (f"`{spec.name}`", f"`{as_typed(spec.default)}`", meaning, allowed, about.source)
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)


def _put(files: Files, file: File) -> None:
    """Add a file in the place of its namesake."""
    present = files.get_file_from_path(file.src_uri)
    if present is not None:
        files.remove(present)
    files.append(file)


def place_of(path: str) -> str:
    """Return where a file of the repository is on the site."""
    if path in PLACES:
        return PLACES[path]
    if path.startswith("docs/"):
        return path.removeprefix("docs/")
    return f"repository/{path}.md" if path.endswith(".py") else f"repository/{path}"


def site_links(text: str, source: str, page: str) -> tuple[str, set[str]]:
    """Return a page with links of the site, and the files outside `docs/` that it links to.

    Args:
        text: The page, in Markdown.
        source: Its path in the repository.
        page: Its path on the site.

    Returns:
        The page with its links rewritten; paths in the repository.

    Raises:
        FileNotFoundError: It links to what is not in the repository.
    """
    targets: set[str] = set()

    def rewritten(link: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(posixpath.dirname(source), link[2]))
        if not (ROOT / target).is_file():
            raise FileNotFoundError(f"{source} links to {link[2]}, which is no file")
        if target not in PLACES and not target.startswith("docs/"):
            targets.add(target)
        return link[1] + os.path.relpath(place_of(target), posixpath.dirname(page) or ".")

    parts, end = [], 0
    for fence in FENCE.finditer(text):  # what looks like a link there is code
        parts += [LINK.sub(rewritten, text[end : fence.start()]), fence[0]]
        end = fence.end()
    return "".join([*parts, LINK.sub(rewritten, text[end:])]), targets


def paper_map() -> str:
    """Return the page that maps the paper's equations to the code, made from the package's map."""
    entries = MAP_LINE.findall(swarm_mj.__doc__ or "")
    rows = [
        f"| {section} | {item} | {what} | [`{target}`][swarm_mj.{target}] |"
        for section, item, what, target in entries
    ]
    elsewhere = {home_of(name) for name in names_of((ROOT / "docs/api.md").read_text("utf-8"))}
    targets = dict.fromkeys(f"swarm_mj.{target}" for *_, target in entries)
    shown = [f"::: {target}\n" for target in targets if target not in elsewhere]
    return "\n".join([MAP_INTRODUCTION, *rows, "\n## The code\n", *shown])


def names_of(page: str) -> list[str]:
    """Return the names that a page explains from their docstrings."""
    return re.findall(r"^::: (\S+)$", page, re.MULTILINE)


def home_of(name: str) -> str:
    """Return a name by the module in which it is defined, where `swarm_mj` itself has it, too."""
    found = getattr(swarm_mj, name.removeprefix("swarm_mj."), None)
    own = getattr(found, "__qualname__", None)
    return f"{getattr(found, '__module__', '')}.{own}" if own else name


MAP_INTRODUCTION = """# From the paper to the code

Where each section, equation, algorithm and figure of
[the paper](https://arxiv.org/abs/2103.05091) is in the code.
A name leads to its description; open "Source code" there to read the code itself.

| section | equation | what it says | code |
|---|---|---|---|"""
