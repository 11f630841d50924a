"""What others cite and read first says the same as the package."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text())
FORMS = sorted((ROOT / ".github/ISSUE_TEMPLATE").glob("[!c]*.yml"))


@pytest.mark.parametrize("field", ["version", "license"])
def test_the_citation_is_of_this_package(field):
    assert CITATION[field] == PROJECT[field]
    assert CITATION["title"].startswith(PROJECT["name"])


def test_readers_see_this_version_in_the_bibtex_and_the_wheel_s_name():
    assert f"version = {{{PROJECT['version']}}}" in (ROOT / "README.md").read_text()
    year = CITATION["date-released"][:4]
    assert f"year    = {{{year}}}" in (ROOT / "README.md").read_text()
    wheels = re.findall(r"swarm_mj-(\S+)-py3-none-any\.whl", (ROOT / "docs/python.md").read_text())
    assert wheels == [PROJECT["version"]]


def test_the_paper_is_cited_alike_everywhere():
    paper = CITATION["preferred-citation"]
    assert paper["url"] == PROJECT["urls"]["Paper"]
    surnames = [author["family-names"] for author in paper["authors"]]
    assert ", ".join(surnames) == "Tolstaya, Butler, Mox, Paulos, Kumar, Ribeiro"
    assert paper["title"] in " ".join((ROOT / "README.md").read_text().split())


def test_the_changelog_has_this_version_and_what_comes():
    headings = re.findall(r"^## (.+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    released = f"{PROJECT['version']} - {CITATION['date-released']}"
    assert headings[:2] == ["Unreleased", released]


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.stem)
def test_an_issue_form_asks_something(form):
    """As GitHub wants it: a name, a description, and fields with ids and labels."""
    asked = yaml.safe_load(form.read_text())
    assert all((asked["name"], asked["description"]))
    ids = [field["id"] for field in asked["body"]]
    assert len(ids) == len(set(ids)) > 0
    assert all(field["attributes"]["label"] for field in asked["body"])


def test_ci_runs_what_a_change_must_pass():
    jobs = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())["jobs"]
    assert {"run": ".ci/run", "env": {"PYTHON": "python"}} in jobs["test"]["steps"]
    systems = jobs["test"]["strategy"]["matrix"]
    assert systems["os"] == ["ubuntu-latest", "macos-latest"]
    assert f">={systems['python'][0]}" == PROJECT["requires-python"]
