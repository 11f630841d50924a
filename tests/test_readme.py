"""The README and the pages under docs/: their Python runs, their commands and links exist."""

import re
import shlex
from pathlib import Path

import pytest

from swarm_mj.cli import parse

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
TEXTS = {page.name: page.read_text(encoding="utf-8") for page in PAGES}
EXAMPLES = [
    pytest.param(name, code, id=f"{name}-{n}")
    for name, text in TEXTS.items()
    for n, code in enumerate(re.findall(r"```python\n(.*?)```", text, re.DOTALL))
]
COMMANDS = sorted(
    {command for text in TEXTS.values() for command in re.findall(r"^swarm-mj (.+)$", text, re.M)}
)
LINKS = [
    (page, target)
    for page in PAGES
    for target in re.findall(r"\]\(([^)#]+)\)", TEXTS[page.name])
    if not target.startswith("http")
]
MAP = re.findall(r"^  ([a-z_]+(?:\.py|/))", TEXTS["code.md"], re.MULTILINE)


@pytest.mark.parametrize(("name", "code"), EXAMPLES)
def test_an_example_runs(name, code, capsys):
    exec(compile(code, name, "exec"), {"__name__": "readme"})
    assert capsys.readouterr().out.strip()


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_is_understood(command):
    run, _ = parse(shlex.split(command, comments=True))
    assert callable(run)


@pytest.mark.parametrize(("page", "target"), LINKS, ids=str)
def test_a_link_leads_somewhere(page, target):
    assert (page.parent / target).exists()


def test_the_readme_is_short_and_there_are_examples_commands_and_links():
    assert len(TEXTS["README.md"].splitlines()) <= 125
    assert len(EXAMPLES) == 3
    assert len(COMMANDS) >= 10
    assert len(LINKS) >= 10


def test_the_map_of_the_code_is_the_package():
    package = ROOT / "swarm_mj"
    rooms = {f"{path.name}/" for path in package.iterdir() if (path / "__init__.py").exists()}
    files = {path.name for path in package.glob("*.py")} - {"__init__.py", "__main__.py"}
    assert set(MAP) == rooms | files
