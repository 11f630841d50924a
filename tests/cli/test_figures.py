"""`swarm-mj figures` as a process: files in, figures out, or one clear line."""

import runpy
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
from PIL import Image

from swarm_mj.evaluation.results import COLUMNS, write_csv

SYNTHETIC = runpy.run_path(
    str(Path(__file__).parent.parent / "evaluation" / "figures" / "synthetic.py")
)


@pytest.fixture
def results(tmp_path):
    write_csv(tmp_path / "all.csv", SYNTHETIC["everything"]())
    return "all.csv"


def refusal(done):
    """The one line of a command that refused its input."""
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.strip().splitlines()
    return line


def test_every_figure_is_drawn_as_vectors_and_as_pixels(swarm_mj, tmp_path, results):
    done = swarm_mj("figures", results, "--out", "pictures")
    assert done.returncode == 0, done.stderr
    names = [f"fig{n}.{kind}" for n in range(2, 7) for kind in ("png", "svg")]
    assert sorted(path.name for path in (tmp_path / "pictures").iterdir()) == names
    for name in names:
        assert f"pictures/{name}" in done.stdout
    ElementTree.parse(tmp_path / "pictures" / "fig4.svg")
    with Image.open(tmp_path / "pictures" / "fig2.png") as picture:
        picture.verify()


def test_only_what_is_asked_for(swarm_mj, tmp_path, results):
    done = swarm_mj(
        *("figures", results, "--out", "a/b", "--figure", "fig5", "--format", "pdf", "svg", "pdf")
    )
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in (tmp_path / "a" / "b").iterdir()) == [
        "fig5.pdf",
        "fig5.svg",
    ]


def test_several_files_are_one(swarm_mj, tmp_path):
    everything = SYNTHETIC["everything"]()
    write_csv(tmp_path / "one.csv", everything[:3])
    write_csv(tmp_path / "other.csv", everything[3:])
    draw = ("figures", "one.csv", "other.csv", "--figure", "fig4", "fig5", "--out", ".")
    assert swarm_mj(*draw).returncode == 0


def test_nothing_is_overwritten_unasked_and_nothing_written_when_one_is_in_the_way(
    swarm_mj, tmp_path, results
):
    (tmp_path / "fig5.png").write_text("mine")
    draw = ("figures", results, "--out", ".", "--figure", "fig4", "fig5")
    line = refusal(swarm_mj(*draw))
    assert "fig5.png exists" in line
    assert "--force" in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["all.csv", "fig5.png"]
    assert (tmp_path / "fig5.png").read_text() == "mine"
    assert swarm_mj(*draw, "--force").returncode == 0
    assert (tmp_path / "fig5.png").read_bytes().startswith(b"\x89PNG")


def test_a_figure_without_points_is_named_with_its_command_and_none_is_written(swarm_mj, tmp_path):
    write_csv(tmp_path / "some.csv", SYNTHETIC["everything"]()[:3])
    line = refusal(swarm_mj("figures", "some.csv", "--out", ".", "--figure", "fig4", "fig6"))
    assert "fig6 has no points" in line
    assert "swarm-mj evaluate --policy tdma " in line
    assert " greedy-oracle --task flocking --preset reference" in line
    assert [path.name for path in tmp_path.iterdir()] == ["some.csv"]


def test_unasked_figures_without_points_are_left_out_unless_all_are(swarm_mj, tmp_path):
    walks, rest = (
        [one for one in SYNTHETIC["everything"]() if one.task == task]
        for task in ("random-walk", "stationary")
    )
    write_csv(tmp_path / "rest.csv", rest)
    done = swarm_mj("figures", "rest.csv", "--out", ".", "--format", "svg")
    assert done.returncode == 0, done.stderr
    assert "Wrote fig2.svg fig3.svg fig4.svg" in done.stdout
    assert "Left out fig5, fig6: the results hold no point of them" in done.stdout
    assert sorted(path.name for path in tmp_path.glob("*.svg")) == [
        f"fig{n}.svg" for n in (2, 3, 4)
    ]
    elsewhere = [replace(one, task="flocking", range_ratio=0.9) for one in walks]
    write_csv(tmp_path / "none.csv", elsewhere)
    assert "fig6 has no points" in refusal(swarm_mj("figures", "none.csv", "--out", "x"))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "lacks the columns policy, task"),
        ("policy,task\nmst,stationary\n", "lacks the columns preset"),
        (",".join(COLUMNS) + "\n", "has no rows"),
        ("\x00\xff", "bad.csv"),
    ],
)
def test_bad_result_files_are_refused(swarm_mj, tmp_path, text, complaint):
    (tmp_path / "bad.csv").write_text(text, encoding="latin-1")
    assert complaint in refusal(swarm_mj("figures", "bad.csv", "--out", "."))


def test_a_missing_file_and_a_folder_are_refused(swarm_mj, tmp_path):
    assert "missing.csv" in refusal(swarm_mj("figures", "missing.csv", "--out", "."))
    (tmp_path / "folder").mkdir()
    assert "folder" in refusal(swarm_mj("figures", "folder", "--out", "."))


def test_two_presets_are_refused(swarm_mj, tmp_path, results):
    write_csv(tmp_path / "paper.csv", SYNTHETIC["everything"]("paper"))
    line = refusal(swarm_mj("figures", results, "paper.csv", "--out", ".", "--figure", "fig4"))
    assert "presets reference and paper; draw one at a time" in line


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--figure", "fig9"], "figure must be one of fig2, fig3, fig4, fig5, fig6, not 'fig9'"),
        (["--format", "gif"], "format must be one of svg, png, pdf, not 'gif'"),
        (["--figure", "fig2", "--flock-policy", "nobody"], "policy must be one of"),
        (["--figure", "fig2", "--flock-seed", "-1"], "seeds must be"),
    ],
)
def test_bad_options_are_refused(swarm_mj, results, options, complaint):
    assert complaint in refusal(swarm_mj("figures", results, "--out", ".", *options))


def test_results_of_robots_that_were_told_more_are_not_drawn_beside_the_papers(swarm_mj, tmp_path):
    everything = SYNTHETIC["everything"]()
    write_csv(tmp_path / "all.csv", [replace(everything[0], prior_knowledge="map,start")])
    line = refusal(swarm_mj("figures", "all.csv", "--out", "."))
    assert "row 1 of all.csv was flown with the prior knowledge map,start" in line


@pytest.mark.parametrize("kind", ["channel", "controller", "scene", "radio", "arena"])
def test_results_of_ones_own_parts_are_not_drawn_beside_the_papers(swarm_mj, tmp_path, kind):
    everything = SYNTHETIC["everything"]()
    everything[2] = replace(everything[2], **{kind: "mine:Part"})
    write_csv(tmp_path / "all.csv", everything)
    line = refusal(swarm_mj("figures", "all.csv", "--out", "."))
    assert f"row 3 of all.csv was flown with the {kind} mine:Part" in line
    assert [path.name for path in tmp_path.iterdir()] == ["all.csv"]
