"""The README and the pages under docs/: their code and commands run, what they name exists."""

import re
import shlex
import shutil
import sys
from itertools import chain, groupby
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import pytest
from results_table import MARKER

from swarm_mj.cli import parse

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
TEXTS = {page.name: page.read_text(encoding="utf-8") for page in PAGES}
FENCE = re.compile(
    r"^(?:<!-- not run: (?P<reason>[^\n]+) -->\n+)?```(?P<language>\w*)[^\n]*\n(?P<code>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
# Why a block may stand unrun, and what it then has to mention.
REASONS = {
    "a part of a file": r"<custom>",
    "opens a viewer": "replay|view|show|human",
    "needs OpenGL": "video|render",
    "needs an environment of its own": "benchmarl|torchrl|ray|RecordVideo|minari|bench-peers",
    "installs packages": "^pip install",
    "takes minutes": "train|check",
    "needs SLURM": "slurm",
}
LANGUAGES = {"python", "sh", "", "text", "bibtex", "xml", "toml", "diff"}
# Commands run as they are written, but for less long: what comes last on a line counts.
CUT_SHORT = {
    "bench": "--seconds 0.1 --missions 1 --episodes 0 --no-learning",
    "evaluate": "--windows 10 --episodes 2 --jobs 1",
    "figures": "--figure fig5 --format svg",
    "fly": "--windows 15",
    "train": "--budget 40 --robots 5 --windows 10 --held-out 1",
    "train --resume": "--budget 80",
}
LEARNS = re.compile(r"\.learn\([\d_]+")  # in Python; steps
ONLY_PARSED = re.compile("--minutes 30|study run impairments")  # the page trains less before
# A block that is a file says so in line 1.
FILE = re.compile(r"^(?:# (?P<file>[a-z_]+\.(?:py|toml))|<!-- (?P<scene>[a-z_]+\.xml) -->)\n")


class Block(NamedTuple):
    """A fenced block of a page."""

    page: str
    language: str
    code: str
    reason: str | None  # why it is not run


BLOCKS = [
    Block(page, block["language"], block["code"], block["reason"])
    for page, text in TEXTS.items()
    for block in FENCE.finditer(text)
]
RUN = {
    page: list(blocks)
    for page, blocks in groupby(
        (b for b in BLOCKS if b.language in ("python", "sh", "xml", "toml") and not b.reason),
        lambda b: b.page,
    )
}
LINES = [
    (block.page, line.strip())
    for block in BLOCKS
    if block.language == "sh"
    for line in block.code.replace("\\\n", " ").splitlines()
    if line.strip() and not line.startswith("#")
]
LINKS = [
    (page, target)
    for page in PAGES
    for target in re.findall(r"\]\(([^)#]+)\)", FENCE.sub("", TEXTS[page.name]))
    if not target.startswith("http")
]
MAP = re.findall(r"^  ([a-z_]+(?:\.py|/))", TEXTS["code.md"], re.MULTILINE)


@pytest.fixture
def page_folder(here, monkeypatch):
    """An empty folder with the repository's results, where a page's own files can be imported."""
    (here / "training").symlink_to(ROOT / "training")
    monkeypatch.syspath_prepend(here)
    before = set(sys.modules)
    yield here
    plt.close("all")
    for name in set(sys.modules) - before:
        if str(here) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


@pytest.mark.slow  # what it shows is tested elsewhere; here, that it is shown as it is
@pytest.mark.parametrize("page", RUN)
def test_a_page_runs_from_top_to_bottom(page, page_folder, forks):
    namespace = {"__name__": "page"}
    for block in RUN[page]:
        if block.language == "sh":
            for _, line in (each for each in LINES if each[1] in block.code):
                run_command(line, page_folder, forks)
            continue
        if file := FILE.match(block.code):
            (page_folder / (file["file"] or file["scene"])).write_text(block.code)
        if block.language == "python":
            code = LEARNS.sub(".learn(2_000", block.code)
            exec(compile(code, page, "exec"), namespace)


def run_command(line, folder, forks):
    """Runs a line that is a command of this package's, cut short."""
    program, *arguments = shlex.split(line, comments=True)
    if program == "cp":
        shutil.copy(*arguments)
    if program != "swarm-mj" or ONLY_PARSED.search(line):
        return
    kind = "train --resume" if "--resume" in arguments else arguments[0]
    found = [sorted(map(str, Path().glob(each))) if "*" in each else [each] for each in arguments]
    shortened = shlex.split(CUT_SHORT.get(kind, ""))
    done = forks.run(folder, "swarm_mj", *chain(*found), *shortened)
    assert done.returncode == 0, f"{line}: {done.stderr}"


def test_blocks_that_are_not_run_say_why():
    assert {block.language for block in BLOCKS} <= LANGUAGES
    unrun = (block for block in BLOCKS if block.reason)
    assert all(re.search(REASONS[str(block.reason)], block.code) for block in unrun)


@pytest.mark.parametrize("line", sorted({line for _, line in LINES}))
def test_commands_are_understood_and_other_programs_exist(line):
    """What is run by make or Python stands here; the rest is well known."""
    program, *arguments = shlex.split(line, comments=True)
    if program == "swarm-mj":
        assert callable(parse(arguments)[0])
    elif program == "make":
        targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
        assert {each for each in arguments if "=" not in each} <= set(targets)
    elif program == "cp" or (program.endswith("python") and arguments[0] != "-m"):
        assert (ROOT / arguments[0]).is_file()
    else:
        assert program in {
            *("pip", "git", "tensorboard", ".", ".venv/bin/python", "python"),
            "ray",
            "export",
        }


def test_links_lead_somewhere():
    gone = [(page.name, link) for page, link in LINKS if not (page.parent / link).exists()]
    assert gone == []


@pytest.mark.parametrize("page", TEXTS)
def test_no_paragraph_has_a_line_that_is_hard_to_edit(page):
    """Tables and pictures are a line each, commands are copied whole, and numbers are generated."""
    lines = MARKER.sub("", FENCE.sub("", TEXTS[page])).splitlines()
    assert [line for line in lines if len(line) > 120 and line[:1] not in ("|", "!")] == []


def test_the_readme_is_short_and_there_are_examples_commands_and_links():
    assert len(MARKER.sub("", TEXTS["README.md"]).split()) <= 1500
    assert len(RUN) >= 5
    assert len(LINES) >= 20
    assert len(LINKS) >= 10


def test_the_map_of_the_code_is_the_package():
    package = ROOT / "swarm_mj"
    rooms = {f"{path.name}/" for path in package.iterdir() if (path / "__init__.py").exists()}
    files = {path.name for path in package.glob("*.py")} - {"__init__.py", "__main__.py"}
    assert set(MAP) == rooms | files
