"""Looks differ from each other for every eye; files are whole, valid and the same every time."""

import os
import sys
from itertools import combinations
from types import ModuleType
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image
from synthetic import everything

from swarm_mj.evaluation.figures import quiet_matplotlib
from swarm_mj.evaluation.figures.drawing import draw
from swarm_mj.evaluation.figures.style import FAINT, LOOKS, code, draw_to, look_of, save, styled
from swarm_mj.evaluation.published import FORMATS, RESULT_FIGURES, points
from swarm_mj.policies.about import FEW_BYTES, About, Look
from swarm_mj.policies.policy import CentralisedPolicy
from swarm_mj.policies.registry import LISTED, POLICIES

# Linear RGB as it is seen without red or green cones (Viénot, Brettel, Mollon 1999).
BLINDNESS = {
    "protan": [[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]],
    "deutan": [[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]],
}
# Kinds of GNN look like others of other figures, or like the GNN itself.
ALIKE = ("GNN t", "GNN g", "GNN on", "linear GNN", "one GNN", "GNN with shared")


# It is grey, as what has no look is, so that it stands back in the figures that have room for it.
GREY = "sotdma"


def test_every_policy_has_its_own_look():
    assert [LOOKS[name] for name in POLICIES] == [about.look for about in LISTED.values()]
    assert LOOKS[GREY] == Look(label=GREY, colour=FAINT, marker="d")
    ours = [LOOKS[name] for name in POLICIES if name != GREY]
    for part in ("label", "colour", "marker"):
        assert len({getattr(look, part) for look in ours}) == len(ours)


def test_every_published_method_has_a_look():
    assert {row.method for row in points()} <= set(LOOKS)


class Mine(CentralisedPolicy):
    about = About(
        uses="all",
        beyond=(),
        payload=None,
        look=Look(label="for 5 $", colour="#117733", marker="x"),
        memory=FEW_BYTES,
    )


def test_a_users_own_policy_has_the_look_that_it_declares(monkeypatch):
    module = ModuleType("mine_of_these_figures")
    module.Mine = Mine
    monkeypatch.setitem(sys.modules, module.__name__, module)
    look = look_of("mine_of_these_figures:Mine")
    assert look == Look(label=r"for 5 \$", colour="#117733", marker="x")
    assert look_of("elsewhere:Mine") == Look(label="elsewhere:Mine", colour=FAINT, marker="d")


@pytest.mark.parametrize("kind", BLINDNESS)
def test_colours_stay_apart_for_colour_blind_eyes(kind):
    seen = {
        name: np.clip(np.array(BLINDNESS[kind]) @ np.power(to_rgb(look.colour), 2.2), 0, 1) ** 0.45
        for name, look in LOOKS.items()
        if name != GREY and not name.startswith(ALIKE)
    }
    for (one, a), (other, b) in combinations(seen.items(), 2):
        assert np.linalg.norm(a - b) > 0.14, (one, other)


def test_files_are_whole_and_say_what_their_caption_says(tmp_path):
    drawing = draw(RESULT_FIGURES["fig6"], everything())
    caption = drawing.texts[-1].get_text()
    assert "4 missions, seeds 50 to 53" in caption
    svg, png, pdf = (tmp_path / "new" / f"fig6.{kind}" for kind in FORMATS)
    for path in (svg, png, pdf):
        save(drawing, path)
    assert set((tmp_path / "new").iterdir()) == {svg, png, pdf}
    root = ElementTree.parse(svg).getroot()
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    described = root.iter("{http://purl.org/dc/elements/1.1/}description")
    assert caption in [text.text for text in described]
    assert pdf.read_bytes().startswith(b"%PDF-")
    assert caption.encode() in pdf.read_bytes()
    with Image.open(png) as picture:
        assert picture.size[0] == 1800
        assert picture.text["Description"] == caption


def test_a_figure_is_drawn_once_and_only_where_both_files_can_be_written(tmp_path):
    drawn = []

    def figure():
        drawn.append(draw(RESULT_FIGURES["fig4"], everything()))
        return drawn[-1]

    (tmp_path / "taken.png").mkdir()
    with pytest.raises(ValueError, match=r"figure .*taken\.png"):
        draw_to(tmp_path / "taken", figure)
    assert not drawn
    draw_to(tmp_path / "free", figure)
    assert len(drawn) == 1
    assert {path.name for path in tmp_path.glob("free*")} == {"free.svg", "free.png"}


def test_captions_name_each_commit_once_and_those_that_were_changed():
    assert code("1.2", None) == "swarm_mj 1.2"
    assert code("1.2", "0123456789ab", "0123456789ab") == "swarm_mj 1.2, commit 0123456"
    assert code("1.2", "0123456789ab", "ba9876543210+").endswith(", commits 0123456, ba98765+")


@pytest.mark.parametrize("kind", FORMATS)
def test_the_same_figure_is_the_same_file(tmp_path, kind):
    for name in ("a", "b"):
        save(draw(RESULT_FIGURES["fig4"], everything()), tmp_path / f"{name}.{kind}")
    assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"b.{kind}").read_bytes()
    assert b"CreationDate" not in (tmp_path / f"a.{kind}").read_bytes()


def test_the_users_own_settings_are_neither_used_nor_changed():
    with mpl.rc_context({"font.size": 33.0}):
        with styled():
            assert mpl.rcParams["font.size"] == 9.0
        assert mpl.rcParams["font.size"] == 33.0


def test_commands_open_no_window_and_leave_the_environment_to_others(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "svg")
    with mpl.rc_context({"backend": "svg"}):
        quiet_matplotlib()
        assert mpl.get_backend().lower() == "agg"
    assert os.environ["MPLBACKEND"] == "svg"
