"""`swarm-mj figures` as a process: files in, figures out, or one clear line."""

import runpy
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
from PIL import Image

from swarm_mj.evaluation.results_files import write_results

SYNTHETIC = runpy.run_path(
    str(Path(__file__).parent.parent / "evaluation" / "figures" / "synthetic.py")
)
EVERYTHING = SYNTHETIC["everything"]()


@pytest.fixture
def results(tmp_path):
    write_results(tmp_path / "all.csv", EVERYTHING)
    return "all.csv"


def test_every_figure_is_drawn_as_vectors_and_as_pixels(succeed, tmp_path, results):
    done = succeed("figures", results, "--out", "pictures")
    names = [f"fig{n}.{kind}" for n in range(2, 7) for kind in ("png", "svg")]
    assert sorted(path.name for path in (tmp_path / "pictures").iterdir()) == names
    for name in names:
        assert f"pictures/{name}" in done.stdout
    ElementTree.parse(tmp_path / "pictures" / "fig4.svg")
    with Image.open(tmp_path / "pictures" / "fig2.png") as picture:
        picture.verify()


def test_only_what_is_asked_for_of_several_files_as_of_one(succeed, tmp_path):
    write_results(tmp_path / "one.csv", EVERYTHING[:3])
    write_results(tmp_path / "other.csv", EVERYTHING[3:])
    draw = ("figures", "one.csv", "other.csv", "--figure", "fig5", "--out", "a/b")
    succeed(*draw, "--format", "pdf", "svg", "pdf")
    written = sorted(path.name for path in (tmp_path / "a" / "b").iterdir())
    assert written == ["fig5.pdf", "fig5.svg"]


def test_some_methods_only(succeed, tmp_path, results):
    draw = ("figures", results, "--figure", "fig4", "--format", "pdf")
    for folder, chosen in {"all": (), "some": ("--policy", "mst", "GNN")}.items():
        succeed(*draw, "--out", folder, *chosen)
    every, some = ((tmp_path / name / "fig4.pdf").stat().st_size for name in ("all", "some"))
    assert some < every


def test_nothing_is_overwritten_unasked_and_nothing_written_when_one_is_in_the_way(
    succeed, refusal, tmp_path, results
):
    (tmp_path / "fig5.png").write_text("mine")
    draw = ("figures", results, "--out", ".", "--figure", "fig4", "fig5")
    line = refusal(*draw)
    assert "fig5.png exists" in line
    assert "--force" in line
    assert (tmp_path / "fig5.png").read_text() == "mine"
    succeed(*draw, "--force")
    assert (tmp_path / "fig5.png").read_bytes().startswith(b"\x89PNG")


def test_a_figure_without_points_is_named_with_its_command_and_none_is_written(refusal, tmp_path):
    write_results(tmp_path / "some.csv", EVERYTHING[:3])
    line = refusal("figures", "some.csv", "--out", ".", "--figure", "fig4", "fig6")
    assert "fig6 has no points" in line
    assert "swarm-mj evaluate --task flocking --preset reference" in line


def test_unasked_figures_without_points_are_left_out(succeed, tmp_path):
    write_results(tmp_path / "rest.csv", [one for one in EVERYTHING if one.task == "stationary"])
    done = succeed("figures", "rest.csv", "--out", ".", "--format", "svg")
    assert "Wrote fig2.svg fig3.svg fig4.svg" in done.stdout
    assert "Left out fig5, fig6: the results hold no point of them" in done.stdout
    assert len(list(tmp_path.glob("*.svg"))) == 3


def test_a_missing_file_a_folder_and_two_presets_are_refused(refusal, tmp_path, results):
    (tmp_path / "folder").mkdir()
    (tmp_path / "bad.csv").write_bytes(b"\x00\xff")
    for name in ("missing.csv", "folder", "bad.csv"):
        assert name in refusal("figures", name, "--out", ".")
    write_results(tmp_path / "paper.csv", SYNTHETIC["everything"]("paper"))
    line = refusal("figures", results, "paper.csv", "--out", ".", "--figure", "fig4")
    assert "presets reference and paper; draw one at a time" in line


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ("--figure fig9", "figure must be one of fig2, fig3, fig4, fig5, fig6, not 'fig9'"),
        ("--format gif", "format must be one of svg, png, pdf, not 'gif'"),
        ("--figure fig2 --flock-policy nobody", "policy must be one of"),
        ("--figure fig4 --policy mst nobody", "policy must be one of random-flooding, "),
        ("--figure fig2 --flock-seed -1", "seeds must be"),
    ],
)
def test_bad_options_are_refused(refusal, results, options, complaint):
    assert complaint in refusal("figures", results, "--out", ".", *options.split())


KINDS = dict.fromkeys(("channel", "controller", "scene", "radio", "arena"), "mine:Part")
KINDS |= {"prior_knowledge": "map,start"}


@pytest.mark.parametrize("kind", KINDS)
def test_results_beyond_the_papers_missions_are_not_drawn_beside_its_own(refusal, tmp_path, kind):
    """Nor those of one's own parts."""
    row = replace(EVERYTHING[2], **{kind: KINDS[kind]})
    write_results(tmp_path / "all.csv", [*EVERYTHING[:2], row])
    line = refusal("figures", "all.csv", "--out", ".")
    usual = {"arena": "open", "prior_knowledge": "nothing"}.get(kind, "none")
    assert f"the paper's missions, in which {kind} is {usual}, not {KINDS[kind]} (" in line
    assert line.endswith("or chart others with `swarm-mj evaluate --plot FILE`")
