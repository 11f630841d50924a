"""The committed figures against the committed results: `make figures` makes both agree."""

import re
import shlex
from pathlib import Path
from xml.etree import ElementTree

import pytest
from PIL import Image

from swarm_mj.evaluation.figures.curves import method_of, results_of
from swarm_mj.evaluation.figures.drawing import caption
from swarm_mj.evaluation.published import FLOCK, RESULT_FIGURES
from swarm_mj.evaluation.results_files import read_results

ROOT = Path(__file__).parent.parent.parent
DESCRIPTION = "{http://purl.org/dc/elements/1.1/}description"
REMAKE = "in a clean checkout, `make figures` draws the results, with ARGS=--force makes them anew"
PRESETS = ("paper", "reference")


def written(preset, name, kind):
    """A committed figure's own caption."""
    path = ROOT / "assets" / "figures" / preset / f"{name}.{kind}"
    if kind == "png":
        with Image.open(path) as picture:
            return picture.text.get("Description", "")
    return "".join(node.text or "" for node in ElementTree.parse(path).iter(DESCRIPTION))


@pytest.fixture(scope="module", params=PRESETS)
def results(request):
    """All committed results of a preset."""
    files = sorted((ROOT / "training" / "results").glob(f"{request.param}-*.csv"))
    return request.param, [result for file in files for result in read_results(file)]


def reproduced(preset, name):
    """What GNNs cost that were trained anew for a figure, and the one for Figs. 4 to 6."""
    folder = ROOT / "training" / "results" / "reproduce" / "quick"
    names = (name,) if name == "fig3" else (name, "one")
    paths = [folder / f"{each}.csv" for each in names if (folder / f"{each}.csv").exists()]
    return [result for path in paths for result in read_results(path)] if preset == "paper" else []


def drawn_methods():
    """The methods that `make figures` draws of the paper's."""
    lines = (ROOT / "Makefile").read_text().replace("\\\n", " ").splitlines()
    (line,) = (line for line in lines if line.startswith("PAPERS := "))
    return shlex.split(line.removeprefix("PAPERS := "))


@pytest.mark.parametrize("kind", ["svg", "png"])
@pytest.mark.parametrize("name", RESULT_FIGURES)
def test_a_figure_s_caption_is_that_of_its_results(results, name, kind):
    """The same commit, number of missions and seeds."""
    preset, rows = results
    figure = RESULT_FIGURES[name]
    trained = reproduced(preset, name)
    # GNNs of Fig. 3 fly fewer missions than the baselines do: `make figures` leaves those out.
    rows = trained if name == "fig3" and trained else [*rows, *trained]
    found = results_of(figure, rows)
    if preset == "paper":
        found = [result for result in found if method_of(result) in drawn_methods()]
    assert written(preset, name, kind) == caption(figure, found), REMAKE


def test_all_results_of_a_preset_are_of_one_commit_and_as_many_missions(results):
    _, rows = results
    assert len({(row.commit, row.episodes, row.seed) for row in rows}) == 1, REMAKE
    assert re.fullmatch(r"[0-9a-f]{12}", rows[0].commit), REMAKE


@pytest.mark.parametrize("preset", PRESETS)
def test_the_flock_is_flown_by_clean_code(preset):
    assert re.search(r"commit [0-9a-f]{7}$", written(preset, FLOCK, "svg")), REMAKE
