"""The documentation's site builds without a warning and loads nothing from elsewhere."""

import json
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path

import pytest
from documentation import mission_fields, names_of, site_links
from notebook_page import can_render

import swarm_mj

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    return folder


def test_the_names_that_stay_are_all_at_the_top_and_others_by_where_they_are():
    names = names_of((ROOT / "docs/api.md").read_text(encoding="utf-8"))
    assert len(names) == len(set(names))
    homes = {name: name.rpartition(".")[::2] for name in names}
    assert {name for home, name in homes.values() if home == "swarm_mj"} == set(swarm_mj.__all__)
    for home, name in homes.values():
        assert not name.startswith("_")
        assert getattr(import_module(home), name) is not None


class Loaded(HTMLParser):
    """What a browser loads for a page, and where its links lead."""

    def __init__(self):
        super().__init__()
        self.files, self.links = [], []

    def handle_starttag(self, tag, attrs):
        known = dict(attrs)
        if tag in ("img", "script", "video", "source", "iframe") and known.get("src"):
            self.files.append(known["src"])
        if tag == "link" and known.get("rel") in ("stylesheet", "icon", "preconnect"):
            self.files.append(known["href"])
        if tag == "a" and known.get("href"):
            self.links.append(known["href"])


@pytest.mark.slow
def test_every_page_loads_files_of_the_site_only(built):
    pages = sorted(built.rglob("*.html"))
    assert len(pages) >= 10
    for page in (each for each in pages if each.name != "404.html"):
        loaded = Loaded()
        loaded.feed(page.read_text(encoding="utf-8"))
        inside = [each for each in loaded.files if not each.startswith("data:")]
        assert not [each for each in inside if ":" in each or each.startswith("//")]
        local = [each for each in loaded.links if not re.match(r"[a-z]+:|#", each)]
        for target in (*inside, *local):
            path = page.parent / re.split(r"[?#]", target)[0]
            assert path.exists(), f"{page.name}: {target}"


@pytest.mark.slow
def test_the_home_has_four_cards_and_the_overview_is_the_readme(built):
    assert (built / "index.html").read_text(encoding="utf-8").count('class="card"') == 4
    home = (built / "overview.html").read_text(encoding="utf-8")
    assert (ROOT / "README.md").read_text(encoding="utf-8").startswith("# swarm_mj")
    assert "age of information" in home
    assert (built / "repository/assets/figures/paper/fig5.png").stat().st_size > 10_000


@pytest.mark.slow
def test_the_tour_shows_what_its_cells_show(built):
    page = (built / "tour.html").read_text(encoding="utf-8")
    assert "<td style='text-align:left'>10.54 windows" in page  # of the default flight
    assert page.count("data:image/png;base64,") == 2
    assert ("data:video/mp4;base64," in page) == can_render()
    notebook = json.loads((ROOT / "docs/tour.ipynb").read_text(encoding="utf-8"))
    assert not any(cell.get("outputs") for cell in notebook["cells"])  # they are made when shown


@pytest.mark.slow
def test_every_equation_leads_to_its_code(built):
    page = (built / "paper-map.html").read_text(encoding="utf-8")
    assert all(f"<td>Eq. {n}</td>" in page for n in range(1, 18))
    assert '<span class="n">interference</span>' in page  # the code itself is there


def test_links_between_files_become_links_of_the_site():
    text = """[a](docs/policies.md#list) ![b](assets/figures/readme.png) [c](https://x.org)
```
[f](no/link)
```
"""
    linked, targets = site_links(text, "README.md", "index.md")
    assert linked == text.replace("docs/", "").replace("(assets", "(repository/assets")
    assert targets == {"assets/figures/readme.png"}
    linked, targets = site_links("[a](../README.md) [b](code.md)", "docs/x.md", "x.md")
    assert (linked, targets) == ("[a](overview.md) [b](code.md)", set())


def test_a_link_to_nothing_is_an_error():
    with pytest.raises(FileNotFoundError, match=r"README\.md links to docs/none\.md"):
        site_links("[a](docs/none.md)", "README.md", "index.md")


def test_a_mission_s_fields_stand_with_units_and_defaults():
    rows = mission_fields().splitlines()
    assert (
        "| `noise_dbm` | `-50` | noise power; transmit power changes with it, so the range stays | "
        "-200 to 50 [dBm] | IV-B |" in rows
    )
