"""The diagrams of the documentation: all are drawn, in the reader's colours, and all are shown."""

import re
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TOOL = ROOT / "tools" / "diagrams.py"
SHOWN = re.findall(r"\(pictures/(\w+)\.svg\)", (ROOT / "docs/concepts.md").read_text())
SIZE = re.compile(r'viewBox="0 0 (\S+) (\S+)"')


@pytest.fixture(scope="module")
def drawn(forks, tmp_path_factory):
    folder = tmp_path_factory.mktemp("diagrams")
    done = forks.run(folder, TOOL, "--out", ".")
    assert done.returncode == 0, done.stderr
    return {path.stem: path.read_text() for path in folder.iterdir()}


def test_the_page_shows_what_is_drawn(drawn):
    assert sorted(drawn) == sorted(SHOWN)
    for name, svg in drawn.items():
        committed = (ROOT / f"docs/pictures/{name}.svg").read_text()
        assert SIZE.search(svg)[0] == SIZE.search(committed)[0]


def test_every_colour_is_one_of_the_theme_s(drawn):
    """No placeholder is left, and all that is used is defined for light and dark."""
    for svg in drawn.values():
        defined = re.findall(r"--(\w+):#[0-9a-f]{6}", svg)
        assert len(defined) == 2 * len(set(defined))
        assert set(re.findall(r"var\(--(\w+)\)", svg)) <= set(defined)
        _, _, body = svg.partition("</style>")
        assert "#0101" not in body


def test_the_age_falls_when_news_comes(drawn):
    """In the drawn saw teeth news of four hops is never younger than that of one."""
    near, far = (
        [float(y) for y in re.findall(r"[ML] \S+ (\S+)", line)]
        for line in re.findall(r'<path d="((?:[ML] \S+ \S+\s*){41})"', drawn["age"])
    )
    assert max(far) < min(near)  # an SVG's y grows downwards
    assert sum(after > before for before, after in pairwise(near)) == 4
